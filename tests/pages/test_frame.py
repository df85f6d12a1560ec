"""The frame of every page: drawn once, with the reader's own parts put in for few queries."""

from __future__ import annotations

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext

from core.pages.registry import sections
from core.templatetags import site
from league.models import Notice
from league.notices import kinds
from tests.pages.conftest import World

FRAME_ALONE = "/no/such/page/"


def page(client: Client, path: str = FRAME_ALONE, **headers: str) -> str:
    return client.get(path, headers=headers).content.decode()


@pytest.mark.parametrize("hides", [False, True])
@pytest.mark.parametrize("kind", [None, kinds.OPENS])
def test_the_frame_needs_session_racer_notices_and_the_position(world: World, hides: bool, kind) -> None:
    """Hidden results are looked up only for a notice that may show them."""
    type(world.alice).objects.filter(pk=world.alice.pk).update(hides_results_since=world.now if hides else None)
    if kind is not None:
        Notice.objects.create(racer=world.alice, kind=kind, about="1", params={"race": "X"}, at=world.now)
    client = world.client("alice")
    with CaptureQueriesContext(connection) as sent:
        html = page(client)
    assert ('class="bell-count"' in html) is (kind is not None)
    assert len(sent) <= 4, "\n".join(query["sql"] for query in sent)


def test_an_unread_notice_that_shows_a_hidden_result_is_not_counted(world: World) -> None:
    client = world.client("alice")
    for kind, path in ((kinds.RESULT, world.race.get_absolute_url()), (kinds.OPENS, "/races/")):
        Notice.objects.create(racer=world.alice, kind=kind, about="1", params={"race": "X"}, path=path, at=world.now)
    assert 'class="bell-count">2<' in page(client)
    type(world.alice).objects.filter(pk=world.alice.pk).update(hides_results_since=world.now)
    assert 'class="bell-count">1<' in page(client)


def test_each_page_marks_its_section_in_a_frame_that_is_drawn_once(world: World) -> None:
    client = world.client("alice")
    site._drawn.cache_clear()
    for _ in range(2):
        for section in sections():
            assert 'aria-current="page">' in nav_link(page(client, section.prefixes[0]), section)
    assert site._drawn.cache_info().misses <= len(sections()) + 4  # head, menu, foot, and a page of no section
    assert "aria-current" not in page(client).partition("</nav>")[0]


def nav_link(html: str, section) -> str:
    nav = html.partition('<nav class="nav"')[2].partition("</nav>")[0]
    return next(link for link in nav.split("<a") if f">{section.label}</a>" in link)


def test_the_frame_speaks_the_readers_language_and_holds_nothing_of_another_reader(world: World) -> None:
    alice, bob = world.client("alice"), world.client("bob")
    for _ in range(2):
        assert "이용 안내" in page(alice, accept_language="ko")
        assert "How it works" in page(bob) and "<summary>bob</summary>" in page(bob) and "alice" not in page(bob)
        assert "<summary>alice</summary>" in page(alice) and "bob" not in page(alice)
        assert "<summary>" not in page(Client()) and "Log out" not in page(Client())
