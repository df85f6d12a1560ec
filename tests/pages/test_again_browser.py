"""No spoilers in a real browser: the switch on, nothing tells, the event is watched again, then all is told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta

import pytest
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from league.notices import kinds as notice_kinds
from league.notices.writer import NewNotice, notify
from races.live.services import end_live, prepare_ahead
from races.models import LiveEvent, LiveSlot, WatchedRace
from tests.factories import a_racer, lap, outcome, start
from tests.live_shows import a_live_race, a_show, begun, show
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.test_show_browser import round_the_track

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
LAP_MS = {"bob": 2_900, "carl": 2_400, "dora": 3_050}


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def event(browser, wakes) -> LiveEvent:
    """It ended a while ago: carl won before bob and dora."""
    now, alice = timezone.now() - timedelta(hours=3), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    shown = begun(a_show(now, alice, list(LAP_MS), race=race, order="as_entered"), alice, now)
    for slot in LiveSlot.objects.filter(event=shown).order_by("position"):
        prepare_ahead(event=shown, now=now)
        slot.refresh_from_db()
        run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), now)
        lap_ms = LAP_MS[slot.racer.entry.racer.alias]
        told = replace(outcome([lap(1, lap_ms)]), trace_csv=round_the_track(race.track.geometry, lap_ms))
        assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=now)
        now = show(shown, slot, alice, now)
        shown.refresh_from_db()
    end_live(event=shown, by=alice, seen=shown.version, now=now)
    shown.refresh_from_db()
    return shown


def test_from_no_spoilers_to_the_podium(browser, live_server, event):
    from playwright.sync_api import expect

    zoe = a_racer("zoe")
    notify(
        NewNotice(notice_kinds.FOLLOWED, "n", [zoe.pk], "/races/race-night/", {"race": "Race night", "racer": "carl"}),
        timezone.now(),
    )
    Racer.objects.filter(pk=zoe.pk).update(hides_results_since=timezone.now() - timedelta(days=1))
    wrong: list[str] = []
    page = visitor(browser, live_server.url, zoe).new_page()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)

    for address in ("/", "/races/", "/races/race-night/", "/races/race-night/event/", "/racers/carl/", "/notices/"):
        page.goto(address)
        expect(page.locator("body")).not_to_contain_text("2.400")
        assert "carl" not in page.title() or address == "/racers/carl/"
    expect(page.locator(".bell-count")).to_have_count(0)
    page.goto("/races/race-night/")
    expect(page.locator("#board")).to_contain_text("Results are hidden")
    page.get_by_role("link", name="Watch : Race night").click()

    page.wait_for_url("**/event/again/")
    expect(page.locator("[data-who]")).to_have_text("bob")
    expect(page.locator("[data-clock]")).to_contain_text("starts in")
    expect(page.locator("[data-tower] li").first).to_contain_text("–")
    # at its real pace: the car drives, and its lap is told when it is over
    expect(page.locator('[data-car="0"]')).to_be_visible(timeout=15_000)
    expect(page.locator("[data-last-lap]")).to_have_text("0:02.900", timeout=15_000)
    expect(page.locator("[data-tower] li").first).to_contain_text("bob", timeout=15_000)
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Next run").click()
    expect(page.locator("[data-who]")).to_have_text("carl")
    page.get_by_role("button", name="Play", exact=True).press("Enter")
    page.get_by_role("button", name="To its end").click()
    expect(page.locator("[data-tower] li").first).to_contain_text("carl")
    moved_about_in(page)
    page.get_by_role("combobox", name="Run").select_option(label="Run 3: dora")
    expect(page.locator("[data-who]")).to_have_text("dora")
    assert not WatchedRace.objects.exists()
    page.get_by_role("button", name="Next run").click()
    expect(page.locator("[data-podium]")).to_contain_text("carl")
    page.get_by_role("link", name="All results").click()
    expect(page.locator("#live-standings")).to_be_visible()
    assert WatchedRace.objects.get().racer == zoe
    page.goto("/races/race-night/")
    expect(page.locator("#board")).to_contain_text("2.400")
    expect(page.locator(".bell-count")).to_contain_text("1")
    assert not wrong


def moved_about_in(page) -> None:
    """The run can be searched, at another speed and step by step; what comes later in it is not told before."""
    from playwright.sync_api import expect

    seek, tower = page.locator("[data-seek]"), page.locator("ol[data-tower] li")
    page.get_by_role("button", name="Pause").click()
    seek.fill("3500")  # half a second after its start
    expect(page.locator("[data-who]")).to_have_text("carl")
    expect(tower.first).to_contain_text("bob")
    expect(page.locator("[data-last-lap]")).to_have_text("–")
    expect(page.locator("[data-sectors] li")).to_have_count(0)
    seek.fill("5450")
    expect(page.locator("[data-last-lap]")).to_have_text("0:02.400")
    expect(page.locator("[data-sectors] li")).to_have_count(3)
    expect(tower.first).to_contain_text("carl")
    seek.fill("4000")
    expect(page.locator("[data-last-lap]")).to_have_text("–")
    expect(tower.first).to_contain_text("bob")
    before = page.locator('[data-car="0"]').get_attribute("style")
    page.get_by_role("button", name="A step on").click()
    assert 4_000 < int(seek.input_value()) <= 4_067
    expect(page.locator('[data-car="0"]')).not_to_have_attribute("style", before)
    page.get_by_label("Speed of the replay").select_option("8")
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.locator("[data-who]")).to_have_text("dora")  # the next begins by itself
    page.get_by_label("Speed of the replay").select_option("1")


def test_a_guest_hides_and_shows(browser, live_server, event):
    from playwright.sync_api import expect

    LiveEvent.objects.update(ended_at=timezone.now() + timedelta(hours=1))  # it ends after the switch
    page = visitor(browser, live_server.url, viewport={"width": 360, "height": 740}).new_page()
    page.goto("/")
    page.get_by_role("link", name="No spoilers").click()
    page.get_by_role("button", name="Hide results from now on").press("Enter")
    expect(page.get_by_role("status")).to_contain_text("Results are hidden since")
    page.goto("/races/race-night/event/")
    expect(page.get_by_role("heading", name="Results are hidden")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.get_by_role("button", name="Show the results").click()
    expect(page.locator("#live-standings")).to_be_visible()
