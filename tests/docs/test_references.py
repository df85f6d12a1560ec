"""Docstrings refer to modules that exist: a module that moves takes the references to it along."""

from __future__ import annotations

import re
from importlib.util import resolve_name
from pathlib import Path

import pytest

from .pages import CHECKOUT

ROOMS = sorted(folder.parent.name for folder in CHECKOUT.glob("*/__init__.py") if folder.parent.name != "tests")
REFERENCE = re.compile(r":(?:mod|func|class|data|attr|meth|exc):`~?([\w.]+)`")


def module_of(name: str) -> Path:
    """The file or folder of the longest part of a dotted name that has one."""
    place = CHECKOUT
    for part in name.split("."):
        if (place / part).is_dir():
            place /= part
        elif (place / f"{part}.py").is_file():
            return place / f"{part}.py"
        else:
            break
    return place


def is_there(name: str) -> bool:
    found = module_of(name)
    if found.is_dir():
        found /= "__init__.py"
    left = name.removeprefix(".".join(found.relative_to(CHECKOUT).with_suffix("").parts).removesuffix(".__init__"))
    first = left.lstrip(".").split(".")[0]
    return not first or re.search(rf"\b{first}\b", found.read_text()) is not None


def broken(file: Path) -> list[str]:
    package = ".".join(file.relative_to(CHECKOUT).parent.parts)
    named = REFERENCE.findall(file.read_text())
    whole = [resolve_name(name, package) if name.startswith(".") else name for name in named]
    return [name for name in whole if name.split(".")[0] in ROOMS and not is_there(name)]


@pytest.mark.parametrize("room", ROOMS)
def test_references_in_docstrings_exist(room: str) -> None:
    found = {str(file.relative_to(CHECKOUT)): broken(file) for file in (CHECKOUT / room).rglob("*.py")}
    assert {file: names for file, names in found.items() if names} == {}


def test_a_reference_to_a_module_that_moved_is_found() -> None:
    assert is_there("paddock.exact") and is_there("evaluation.reports.grading.digest_of")
    assert not is_there("evaluation.running.exact") and not is_there("evaluation.rivals.check_rivals")
