"""Every link of the documentation leads somewhere."""

from __future__ import annotations

import re

import pytest

from .pages import CHECKOUT, DECISIONS, DOCS, PAGES, anchors

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
LINKING = [*PAGES, *DECISIONS, *(CHECKOUT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG"))]


@pytest.mark.parametrize("page", LINKING, ids=lambda page: page.name)
def test_relative_links_and_their_anchors_exist(page):
    for target in LINK.findall(page.read_text()):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), f"{page.name} links to {target}"
        if anchor:
            assert anchor in anchors(file.read_text()), f"{page.name} links to {target}"


def test_every_page_is_listed():
    listed = set(LINK.findall((DOCS / "README.md").read_text()))
    assert {page.name for page in PAGES} - {"README.md"} <= listed
