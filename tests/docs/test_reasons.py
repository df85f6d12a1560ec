"""Every reason code is explained, and none that does not exist."""

from __future__ import annotations

from paddock.errors.reasons import REASONS

from . import reason_table
from .pages import text


def test_the_table_has_every_code_of_every_section():
    listed = [code for section in reason_table.SECTIONS.values() for code in section]
    assert set(listed) == set(REASONS)
    assert len(listed) == len(set(listed)), "a code in two sections has two meanings"


def test_the_page_has_the_present_table():
    page = text("racers.md")
    assert page == reason_table.replaced(page), "write it anew with: python -m tests.docs.reason_table"
