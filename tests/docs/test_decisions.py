"""Each decision has its page, in the same form, and names files that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from .pages import CHECKOUT, DECISIONS

RECORDS = [page for page in DECISIONS if page.name != "README.md"]


def test_decisions_are_numbered_and_listed_by_title():
    index = (DECISIONS[0].parent / "README.md").read_text()
    listed = re.findall(r"^(\d+)\. \[(.+)\]\((.+)\)$", index, flags=re.M)
    told = [(int(page.name[:2]), page.read_text().split("\n", 1)[0].removeprefix("# "), page.name) for page in RECORDS]
    assert [(int(number), title, name) for number, title, name in listed] == told
    assert [number for number, _title, _name in told] == list(range(1, len(RECORDS) + 1)) and len(RECORDS) >= 10


@pytest.mark.parametrize("page", RECORDS, ids=lambda page: page.stem)
def test_a_decision_is_complete_and_names_existing_things(page: Path):
    record = page.read_text()
    assert re.findall(r"^## (.+)$", record, flags=re.M) == ["Context", "Decision", "Consequences", "Refused"]
    assert len(record.splitlines()) <= 60
    for name in re.findall(r"`([a-z]+/[\w/]*(?:\.py)?)`", record):
        assert (CHECKOUT / name).exists(), name
