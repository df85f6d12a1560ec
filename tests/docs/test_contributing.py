"""CONTRIBUTING.md names commands, files and rules that there are."""

from __future__ import annotations

import re
import tomllib

from .pages import CHECKOUT, code_blocks

PAGE = (CHECKOUT / "CONTRIBUTING.md").read_text()


def test_every_target_of_make_exists():
    makefile = (CHECKOUT / "Makefile").read_text()
    named = set(re.findall(r"\bmake ([a-z]+)$|`make ([a-z]+)`|^make ([a-z]+) ", PAGE, flags=re.M))
    targets = {name for found in named for name in found if name}
    assert targets >= {"setup", "run", "test", "lint", "soak", "lock"}
    assert all(re.search(rf"^{target}:", makefile, flags=re.M) for target in targets)


def test_every_named_folder_and_file_exists():
    named = re.findall(r"(?<![\w./])((?:tests|paddock|core|docs|locale)/[\w/.]+)", PAGE)
    assert len(named) >= 8
    assert [name for name in named if not (CHECKOUT / name.rstrip(".")).exists()] == []


def test_it_shows_how_to_test_one_room_and_one_file():
    commands = "\n".join(code_blocks(PAGE, ""))
    assert ".venv/bin/python -m pytest -q -n 2 tests/" in commands and re.search(r"tests/\w+/test_\w+\.py", commands)


def test_it_states_the_limits_of_subjects_and_lines():
    lines = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["ruff"]["line-length"]
    assert f"lines are at most {lines} characters" in PAGE
    commit = " ".join(PAGE.split("## Commit")[1].split())
    assert "The subject has at most 72 characters and reads `Room: what is better now`" in commit
    example = re.search(r"for example `(.+?)`", commit)
    assert example and len(example.group(1)) <= 72 and re.match(r"[A-Z]\w+: ", example.group(1))
