"""A guest scans the QR code of a race by invitation, and watches in a real browser."""

from __future__ import annotations

import os
from datetime import timedelta
from pathlib import Path

import pytest
from django.urls import reverse
from django.utils import timezone

from races.entries.services.entries import accept_invitation
from races.models import Visibility
from races.pages.services import renew_spectator_link
from races.web.spectator_links import spectator_token
from tests.factories import a_racer
from tests.live_shows import a_live_race, a_show, begun
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.test_screens_browser import on_track

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
SHOTS = os.environ.get("PADDOCK_TEST_SHOTS", "")  # a folder, for who wants to look


def shot(page, name: str) -> None:
    if not SHOTS:
        return
    for width in (360, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        page.screenshot(path=Path(SHOTS, f"{name}-{width}.png"), full_page=True)


def test_a_guest_watches_by_the_link_until_it_is_renewed(live_server) -> None:
    now = timezone.now()
    alice = a_racer("alice")
    race = a_live_race(now, alice, visibility=Visibility.INVITATION, slug="friends", name="Among friends")
    for alias in ("bob", "carl"):
        accept_invitation(token=race.invitation, racer=a_racer(alias), now=now)
    event = begun(a_show(now, alice, ["bob", "carl"], race=race, order="as_entered"), alice, now)
    on_track(event, "bob", 5)
    sent: list[str] = []
    with chromium() as browser:
        page = visitor(browser, live_server.url).new_page()
        page.on("request", lambda asked: sent.append(asked.headers.get("referer", "")))
        page.goto(f"/watch/{spectator_token(race)}/")
        page.get_by_role("heading", name="bob").wait_for()
        page.locator("[data-clock]").filter(has_text=":").first.wait_for()
        assert page.url.endswith(reverse("live_phone", args=["friends"]))
        assert page.locator("[data-reactions]").count() == 0
        shot(page, "spectator-phone")
        page.goto(f"/watch/{spectator_token(race)}/event/")
        page.get_by_role("heading", name="bob").wait_for()
        assert page.get_by_role("link", name="Among friends").count() == 0, "the race's page is not for spectators"
        shot(page, "spectator-event")
        page.goto(f"/watch/{spectator_token(race)}/overlay/tower/?theme=light")
        page.get_by_role("heading", name="Among friends").wait_for()
        assert not any("/watch/" in referer for referer in sent)
        renew_spectator_link(race=race, now=now + timedelta(seconds=1))
        assert page.goto(reverse("live_phone", args=["friends"])).status == 404

        organiser = visitor(browser, live_server.url, alice).new_page()
        organiser.goto(reverse("race_edit", args=["friends"]))
        race.refresh_from_db()
        assert spectator_token(race) in organiser.get_by_label("Spectators' link").input_value()
        shot(organiser, "race-edit")
        organiser.locator("#spectators").get_by_role("button", name="Replace this link").click()
        organiser.get_by_text("The spectators' link is new.").wait_for()
        organiser.goto(reverse("live_plan", args=["friends"]))
        shot(organiser, "live-plan")
