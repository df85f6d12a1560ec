"""Every reason code is explained, and stands with the code that raises it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from paddock.errors.reasons import REASONS, register
from paddock.rules.hyperparameters import HYPERPARAMETERS
from tests.shared import CHECKOUT

from . import reason_table
from .pages import text

FILES = reason_table.files()
LISTS = sorted((CHECKOUT / "paddock" / "rules").glob("*.py"))  # whose entries name how they are refused


def codes_in(path: Path) -> list[str]:
    return re.findall(r'^        "(\w+)": _\(', path.read_text(), flags=re.M)


def test_the_table_has_a_section_for_every_code():
    assert {reason.subject for reason in REASONS.values()} == set(reason_table.SECTIONS)


def test_the_page_has_the_current_table():
    page = text("reference.md")
    assert page == reason_table.replaced(page), "write it anew with: python -m tests.docs.reason_table"


def test_every_code_is_defined_in_one_file():
    found = [code for path in FILES for code in codes_in(path)]
    assert sorted(found) == sorted(REASONS) and len(FILES) >= 15


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(CHECKOUT)))
def test_a_package_raises_the_reasons_it_defines(path):
    code = "".join(one.read_text() for one in (*path.parent.rglob("*.py"), *LISTS) if one != path)
    assert "reasons" in (path.parent / "__init__.py").read_text(), "nothing loads them"
    # the codes of a list's settings are made of their names
    made = {
        f"{prefix}{one.name}"
        for prefix in re.findall(r'UserFault\(f"(\w+_)\{', code)
        for one in HYPERPARAMETERS.values()
    }
    unsaid = [name for name in codes_in(path) if not re.search(rf"[\"']{name}[\"']", code)]
    assert set(unsaid) <= made


def test_a_code_has_one_message():
    with pytest.raises(ValueError, match="too_large"):
        register("Upload", invalid={"too_large": "Another sentence."})
    with pytest.raises(ValueError, match="nobody"):
        register("Upload", nobody={"new_code": "A sentence."})
    assert "new_code" not in REASONS
