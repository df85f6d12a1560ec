"""A track chosen by its picture in a real browser."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.factories import track_row
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tracks.models import Track

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def test_a_track_is_chosen_by_its_picture(browser, live_server, alice) -> None:
    expect = pytest.importorskip("playwright.sync_api").expect
    track_row("oval")
    Track.objects.filter(pk=track_row("kuei-raceway").pk).update(description="Two long straights.")
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        for address in ("/train/new/", "/races/new/"):
            page.goto(address)
            page.get_by_text("Choose by picture and description").click()
            card = page.locator("[data-of-track=kuei-raceway]")
            expect(card).to_contain_text("Two long straights.")
            expect(card.locator("svg")).to_be_visible()
            card.get_by_role("button", name="Choose").click()
            expect(page.locator("select[name=track]")).to_be_focused()
            expect(card).to_be_hidden()
            chosen = page.locator("select[name=track] option:checked")
            expect(chosen).to_contain_text(card.locator("h3").text_content())
            expect(page.locator("#layout svg")).to_be_visible()  # the map of what is chosen came by itself
