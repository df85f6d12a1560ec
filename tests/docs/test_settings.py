"""docs/operators.md names every setting and every command, with their defaults and options, and no other."""

from __future__ import annotations

import re
from argparse import SUPPRESS
from functools import cache
from pathlib import Path

import pytest
from django.core.management import get_commands, load_command_class

from paddock.cli import settings

from .pages import CHECKOUT, DOCS, everything, section, text

READ_BY_LIBRARIES = {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_ENDPOINT_URL_S3"}
OURS = sorted(path.stem for path in CHECKOUT.glob("*/management/commands/[a-z]*.py") if path.parts[-4] != "core")
OF_EVERY_COMMAND = {
    "help",
    "version",
    "verbosity",
    "settings",
    "pythonpath",
    "traceback",
    "no_color",
    "force_color",
    "skip_checks",
}


def sources() -> list[Path]:
    rooms = ("config", "courses", "league", "races", "videos", "evaluation", "tracks", "accounts", "core", "paddock")
    return [path for room in rooms for path in (CHECKOUT / room).rglob("*.py") if path.name != "env.py"]


@cache
def variables() -> frozenset[str]:
    """Every environment variable that an operator may set."""
    found = set()
    for path in sources():
        code = path.read_text()
        found |= set(re.findall(r'env_\w+\(\s*"([A-Z_]+)"', code))
        found |= set(re.findall(r'^_VARIABLE = "([A-Z_]+)"', code, flags=re.M))
        found |= set(re.findall(r'environ(?:\.get\(|\[)"(PADDOCK_[A-Z_]+)"', code))
    return frozenset(found)


def test_the_search_finds_known_variables():
    assert {"PADDOCK_DATA", "DATABASE_URL", "STORAGE", "PADDOCK_SANDBOX_LEVEL", "PADDOCK_SANDBOX_UIDS"} <= variables()


def test_every_variable_has_a_row():
    described = section(text("operators.md"), "## Environment variables")
    rows = set(re.findall(r"^\| `([A-Z_0-9]+)` \| .+ \| .+ \|$", described, re.M))
    assert sorted(variables() - rows) == []


def test_every_described_variable_is_read():
    named = set(re.findall(r"\b(PADDOCK_[A-Z_]+|AWS_[A-Z_0-9]+|[A-Z]+_URL)\b", everything()))
    of_the_action = set(re.findall(r"(?:vars|secrets)\.(PADDOCK_[A-Z]+)", (DOCS / "examples/submit.yml").read_text()))
    at_home = {settings.SITE, settings.TOKEN, settings.FOLDER}
    assert named <= variables() | READ_BY_LIBRARIES | at_home | of_the_action
    assert at_home <= named


def test_documented_defaults_match_the_settings():
    settings = "".join(path.read_text() for path in sorted((CHECKOUT / "config/settings").glob("*.py")))
    defaults = re.findall(r'env_(?:int|bool)\("([A-Z_]+)", (\w+)[,)]', settings)
    defaults += re.findall(r'env_(?:str|list|url|hosts|choice|sender|time_zone)\("([A-Z_]+)", "([^"]+)"', settings)
    assert len(defaults) > 10
    for name, default in defaults:
        assert re.search(rf"^\| `{name}` \| `{re.escape(default)}`", text("operators.md"), re.M), (name, default)


@pytest.mark.parametrize("name", OURS)
def test_every_command_is_described_with_all_its_options(name):
    described = section(text("operators.md"), "## Commands")
    assert re.search(rf"^\| `{name}\b", described, re.M)
    parser = load_command_class(get_commands()[name], name).create_parser("manage.py", name)
    for action in parser._actions:
        if action.dest in OF_EVERY_COMMAND or action.help == SUPPRESS or not action.option_strings:
            continue
        shown = any(re.search(rf"[`\[ ]{option}\b", described) for option in action.option_strings)
        assert shown, f"{name} {action.option_strings}"


def test_every_described_command_exists():
    named = set(re.findall(r"manage\.py ([a-z_]+)", everything()))
    assert named <= set(get_commands())
    assert set(OURS) <= named | set(re.findall(r"^\| `([a-z_]+)", section(text("operators.md"), "## Commands"), re.M))


def test_every_named_make_target_exists():
    makefile = (CHECKOUT / "Makefile").read_text()
    for target in set(re.findall(r"`make ([a-z-]+)", everything())):
        assert re.search(rf"^{target}:", makefile, re.M), target
