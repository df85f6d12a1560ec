"""Links to the page before and the page after."""

from __future__ import annotations

import re

import pytest
from django.template import Context, Engine
from django.test import RequestFactory

from accounts.models import Racer
from core.pages.pager import kept_pages
from core.streams import shared_pieces
from tests.factories import a_racer


def links(query: str, number: int, pages: int) -> list[str]:
    template = Engine.get_default().from_string("{% load links %}{% pager number pages %}")
    request = RequestFactory().get(f"/races/busy/{query}")
    html = template.render(Context({"request": request, "number": number, "pages": pages}))
    return re.findall(r'href="([^"]*)"', html)


@pytest.mark.parametrize(
    ("query", "number", "pages", "expected"),
    [
        ("", 1, 1, []),
        ("", 1, 2, ["?page=2"]),
        ("?page=2", 2, 3, ["?page=1", "?page=3"]),
        ("?page=3&spoilers=show", 3, 3, ["?spoilers=show&amp;page=2"]),
        ("?group=ours&by=teams", 1, 2, ["?group=ours&amp;by=teams&amp;page=2"]),
        ("?q=%22%3E%3Cscript%3E", 1, 2, ["?q=%22%3E%3Cscript%3E&amp;page=2"]),
    ],
)
def test_a_pager_leads_to_the_pages_beside_and_keeps_the_rest_of_the_address(
    query: str, number: int, pages: int, expected: list[str]
) -> None:
    assert links(query, number, pages) == expected


def test_readers_of_other_addresses_get_other_links() -> None:
    assert links("?group=ours", 1, 2) != links("?group=theirs", 1, 2)


def test_links_of_a_long_address_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = shared_pieces._Lasting(40)
    monkeypatch.setattr(shared_pieces, "_lasting_pieces", kept)
    assert links(f"?q={'x' * 5000}", 1, 2) == [f"?q={'x' * 5000}&amp;page=2"]
    assert not kept._values
    links("?q=x", 1, 2)
    assert len(kept._values) == 1


@pytest.mark.django_db
@pytest.mark.parametrize("number", [None, "", "1", "2", "9", "x"])
@pytest.mark.parametrize("count", [0, 1, 3, 4, 7])
def test_a_first_page_by_a_kept_query_is_that_of_the_whole_list(number: str | None, count: int) -> None:
    for each in range(count):
        a_racer(f"pager-{each}")
    every = Racer.objects.filter(alias__startswith="pager-").order_by("alias")
    kept = kept_pages(number, 3, lambda: list(every[:4]), lambda: every)
    whole = kept_pages(number, 3, None, lambda: every)
    for page in (kept, whole):
        assert (page.number, page.paginator.num_pages, page.paginator.count) == (
            *(whole.number, max(1, -(-count // 3)), count),
        )
    assert list(kept) == list(whole)
