"""The table of ranking methods in the guides, written from their classes.

``python -m tests.docs.ranking_table`` writes it anew after a method was added or changed.
"""

from __future__ import annotations

import os
import re
from inspect import getdoc

import django
from django.utils.translation import override

from races.boards.ranking import RULES, RankingRule
from tests.docs.pages import DOCS

PAGES = (DOCS / "organisers.md", DOCS / "reference.md")
HEAD = "| method | score | classified is who finishes |\n|---|---|---|\n"


def table() -> str:
    """One row a method, in the order of the list."""
    with override("en"):
        return HEAD + "".join(map(_row, RULES.values()))


def _row(rule: RankingRule) -> str:
    text = " ".join((getdoc(rule) or "").split()).rstrip(".")
    laps = "all laps" if rule.needs_all_laps else "N laps in a row"
    return f"| {rule.label} | {text[0].lower()}{text[1:]} | {laps} |\n"


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    page, count = re.subn(rf"{re.escape(HEAD)}(\|.*\n)+", lambda _found: table(), page)
    if count != 1:
        raise ValueError("the page has no table of ranking methods")
    return page


if __name__ == "__main__":
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    for one in PAGES:
        one.write_text(replaced(one.read_text()))
