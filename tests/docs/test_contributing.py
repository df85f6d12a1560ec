"""CONTRIBUTING.md names commands, files and rules that there are."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import yaml

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
    assert "The subject has at most 60 characters" in commit
    example = re.search(r"for example `(.+?)`", commit)
    assert example and len(example.group(1)) <= 72 and re.match(r"[A-Z]\w+: ", example.group(1))


def test_hooks_before_a_commit_call_installed_tools_and_need_no_network():
    (local,) = yaml.safe_load((CHECKOUT / ".pre-commit-config.yaml").read_text())["repos"]
    assert local["repo"] == "local" and {hook["language"] for hook in local["hooks"]} == {"system"}
    words = [word for hook in local["hooks"] for word in hook["entry"].split()]
    tools = {word.removeprefix(".venv/bin/") for word in words if word.startswith(".venv/")}
    assert {"ruff", "mypy", "lint-imports", "python"} == tools
    assert all((Path(sys.executable).parent / tool).exists() for tool in tools)
    assert all((CHECKOUT / word).exists() for word in words if word.endswith(".py"))


def test_the_workflow_calls_the_same_checks_as_a_developer():
    (job,) = yaml.safe_load((CHECKOUT / ".github" / "workflows" / "ci.yml").read_text())["jobs"].values()
    commands = [step["run"].removeprefix("sudo ") for step in job["steps"] if "run" in step]
    assert ".ci/run" in commands
    files = [command.split()[0] for command in commands if "/" in command.split()[0]]
    assert len(files) == 2 and all((CHECKOUT / file).stat().st_mode & 0o100 for file in files)
