"""Hebrew and Arabic names between left-to-right words, in a real browser: nothing beside them changes places."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.utils import timezone

from accounts.groups.services import make_group
from accounts.teams.services import found_team
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.soak import only

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
HEBREW, ARABIC = "מרוץ הלילה 7", "سباق المساء (2)"
# The visual order of a line's pieces: where each text begins, from the left
ORDER = """() => {
  const line = document.createElement("p");
  line.innerHTML = "<bdi>%s</bdi> <span>1</span> · <span>2</span>";
  document.body.append(line);
  const places = [...line.children].map((each) => each.getBoundingClientRect().left);
  line.remove();
  return places;
}"""
WRONG = """() => [...document.querySelectorAll("bdi")].filter((each) => each.offsetParent
    && getComputedStyle(each).direction !== "rtl").map((each) => each.textContent)"""


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.mark.parametrize("width", only([360], [360, 1280]))
def test_names_in_hebrew_and_arabic_keep_the_words_beside_them_in_place(wakes, live_server, browser, width) -> None:
    now = timezone.now()
    alice, bob = a_racer("alice"), a_racer("bob")
    track = a_track()
    track.name = ARABIC
    track.save()
    race = a_race(now, name=HEBREW, description=f"{ARABIC}\n{HEBREW}", track=track, sponsor=ARABIC, organiser=alice)
    found_team(by=alice, name=HEBREW, now=now)
    group = make_group(by=alice, name=ARABIC, description=HEBREW, now=now)
    a_model(alice, name=HEBREW)
    sent = drive(race, alice, laps(11_000, 11_100, 11_200), now)
    drive(race, bob, laps(12_000, 12_100, 12_200), now)
    paths = [
        *("/", "/races/", race.get_absolute_url(), f"{race.get_absolute_url()}rules/", "/models/", "/groups/"),
        *(group.get_absolute_url(), "/teams/", "/tracks/", track.get_absolute_url(), "/racers/alice/"),
        f"/evaluations/{sent.evaluation.public_id}/",
    ]
    with visitor(browser, live_server.url, alice, viewport={"width": width, "height": 800}) as context:
        page = context.new_page()
        for path in paths:
            page.goto(path)
            assert page.locator("bdi").count(), path
            assert page.evaluate(WRONG) == [], path
            assert page.evaluate("document.documentElement.scrollWidth") == width, path
        places = page.evaluate(ORDER.replace("%s", HEBREW))
        assert places == sorted(places)
        page.goto(race.get_absolute_url())
        heading = page.locator("h1")
        assert heading.inner_text().strip().startswith(HEBREW)
