"""A timekeeper in a real browser: laps by button and key, a day without a network, reloads, closed tabs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.utils import timezone

from races.models import Entry, MeasuredLap, TimedSession
from races.timing.services import make_sensor, name_timekeeper, take_crossing
from tests.factories import a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.races.timing import a_physical_race

playwright = pytest.importorskip("playwright.sync_api")
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
expect = playwright.expect


# where the words of a button stand
WORDS = """(button) => {
  const range = document.createRange();
  range.selectNodeContents(button.firstChild);
  return range.getBoundingClientRect().toJSON();
}"""


@pytest.fixture
def browser(request) -> Iterator:
    with chromium(new="network" in request.node.name) as opened:
        yield opened


@pytest.fixture
def race():
    now = timezone.now()
    race = a_physical_race(now, slug="hall-race", organiser=a_racer("olga"), minimum_lap_ms=500, session_s=60)
    Entry.objects.create(race=race, racer=a_racer("alice"))
    name_timekeeper(race=race, alias=a_racer("tim").alias, by=race.organiser, now=now)
    return race


class Keeper:
    """A timekeeper's page."""

    def __init__(self, browser, live_server, racer, **options) -> None:
        self.context = visitor(browser, live_server.url, racer, **options)
        self.wrong: list[str] = []
        self.open()

    def open(self):
        self.page = self.context.new_page()
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.goto("/races/hall-race/timing/")
        self.ready()

    def ready(self):
        expect(self.page.locator("[data-timing][data-ready]")).to_be_attached()

    def kept(self):
        """Wait until the page can be loaded again without a network."""
        expect(self.page.locator("[data-timing][data-kept]")).to_be_attached(timeout=15_000)

    def start(self, name="alice"):
        self.page.get_by_label("Racer").select_option(label=name)
        self.press("Start")

    def press(self, name):
        self.page.get_by_role("button", name=re.compile(f"^{name}")).click()

    def written(self):
        """Wait until the browser has written down what was pressed."""
        expect(self.page.locator("[data-timing]:not([data-keeping])")).to_be_attached()

    def drive(self, milliseconds=620):
        self.page.wait_for_timeout(milliseconds)

    def said(self, words):
        expect(self.page.locator("[data-timing]")).to_contain_text(words)

    def all_sent(self):
        expect(self.page.locator("[data-part=unsent]")).to_have_text("All sent.", timeout=25_000)


@pytest.fixture
def keeper(browser, live_server, race) -> Iterator[Keeper]:
    keeper = Keeper(browser, live_server, race.timekeepers.get().racer)
    yield keeper
    assert not keeper.wrong
    keeper.context.close()


def test_laps_by_button_and_key_come_to_the_board(keeper, race):
    keeper.page.get_by_label("Racer").select_option(label="alice")
    # in one go: a slow machine would press the key after the shortest lap
    keeper.page.evaluate(
        "document.querySelector('[data-do=start]').click();"
        "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'l', bubbles: true}))"
    )
    keeper.said("taken for the same crossing")
    keeper.drive()
    keeper.page.keyboard.press("o")
    keeper.press("Lap")
    keeper.drive()
    keeper.page.keyboard.press("Space")
    keeper.drive()
    keeper.press("Invalid lap")
    keeper.drive()
    for key in ("r", "u", "l", "u", "l", "e"):
        keeper.page.keyboard.press(key)
    keeper.all_sent()
    laps = list(MeasuredLap.objects.order_by("number").values_list("off_tracks", "resets", "valid"))
    assert laps == [(1, 0, True), (0, 0, True), (0, 0, False), (0, 0, True)]
    session, entry = TimedSession.objects.get(), Entry.objects.get(racer__alias="alice")
    assert session.ended_at and session.timekeeper.alias == "tim" and entry.submission_count == 1
    best = min(lap.time_ms + 1000 * lap.off_tracks for lap in session.laps.filter(valid=True))
    assert entry.score_ms == best and 600 <= best < 5_000
    keeper.page.goto("/races/hall-race/")
    expect(keeper.page.locator("#board")).to_contain_text("alice")


def test_a_day_without_a_network_is_carried_over_once(keeper, race):
    """Reloaded, closed and opened again while there is none; sent twice when there is one again."""
    keeper.kept()
    keeper.context.set_offline(True)
    keeper.start()
    keeper.drive()
    keeper.press("Lap")
    keeper.said("have not been sent")
    keeper.said("Offline.")
    keeper.written()
    keeper.page.reload()
    keeper.ready()
    keeper.said("measured by the wall clock")
    keeper.drive()  # a page is loaded faster than the shortest lap
    keeper.press("Lap")
    keeper.drive()
    keeper.press("Lap")
    keeper.press("End session")
    keeper.written()
    keeper.page.goto("about:blank")  # a page that Playwright closes has a network for a moment, and sends
    keeper.page.close()
    keeper.open()
    keeper.page.get_by_label("or a guest").fill("김철수")
    keeper.press("Start")
    keeper.drive()
    keeper.press("Lap")
    keeper.press("End session")
    keeper.said("2 sessions have not been sent")
    sent = []  # what a page that is being closed may yet send, whatever is cut, comes once all the same
    keeper.page.on("request", lambda request: sent.append(request.post_data) if request.method == "POST" else None)
    keeper.context.set_offline(False)
    keeper.all_sent()
    laps = list(MeasuredLap.objects.order_by("session__started_at", "number").values_list("id", "note", "valid"))
    assert [lap[1:] for lap in laps] == [("", True), ("reloaded", True), ("", True), ("", True)]
    guest = Entry.objects.exclude(guest_name="").get()
    assert guest.guest_name == "김철수" and guest.classified
    again = """async (body) => {
      const token = document.cookie.split("; ").find((each) => each.startsWith("csrftoken=")).slice(10);
      const headers = {"Content-Type": "application/json", "X-CSRFToken": token};
      return (await fetch("/api/v1/races/hall-race/sessions/", {method: "POST", headers, body})).status;
    }"""
    assert keeper.page.evaluate(again, sent[-1]) == 200
    assert [lap[0] for lap in laps] == [
        lap for lap in MeasuredLap.objects.order_by("session__started_at", "number").values_list("id", flat=True)
    ]
    assert dict(Entry.objects.values_list("racer__alias", "submission_count"))["alice"] == 1


def test_a_clock_that_jumps_makes_the_lap_invalid(browser, live_server, race):
    keeper = Keeper.__new__(Keeper)
    keeper.context, keeper.wrong = visitor(browser, live_server.url, race.organiser), []
    keeper.context.add_init_script("const real = Date.now.bind(Date); window.jump = 0; Date.now = () => real() + jump;")
    keeper.open()
    keeper.start()
    keeper.drive()
    keeper.page.evaluate("window.jump = 7000")
    keeper.press("Lap")
    keeper.said("stood still or jumped by 7 s")
    keeper.drive()
    keeper.press("Lap")
    keeper.press("End session")
    keeper.all_sent()
    assert list(MeasuredLap.objects.order_by("number").values_list("note", "valid")) == [("clock", False), ("", True)]
    keeper.context.close()


def test_a_refused_session_says_why_and_is_put_right(keeper, race):
    Entry.objects.create(race=race, racer=a_racer("zoe"))
    keeper.start()
    Entry.objects.filter(racer__alias="alice").update(withdrawn_at=timezone.now())
    keeper.drive()
    keeper.press("Lap")
    keeper.press("End session")
    expect(keeper.page.locator("[data-code=entry_withdrawn]")).to_be_visible(timeout=20_000)
    keeper.page.reload()
    keeper.ready()
    keeper.page.get_by_label("Racer").select_option(label="zoe")
    keeper.press("Change to the racer")
    keeper.all_sent()
    assert Entry.objects.get(racer__alias="zoe").classified


def test_a_sensor_times_and_the_timekeeper_counts(browser, live_server, race):
    sensor, _ = make_sensor(race=race, name="Gate", by=race.organiser, now=timezone.now())
    keeper = Keeper(browser, live_server, race.organiser)
    keeper.page.get_by_label("Timed").select_option(label="Gate")
    keeper.start()
    keeper.all_sent()
    begin = timezone.now()
    for number, at_ms in ((1, 0), (2, 900)):
        take_crossing(sensor=sensor, number=number, at_ms=at_ms, now=begin + timedelta(milliseconds=at_ms))
        if number == 1:
            keeper.press("Off track")
    row = keeper.page.locator("[data-part=laps] tr")
    expect(row).to_contain_text("0:01.900", timeout=10_000)
    keeper.press("End session")
    keeper.all_sent()
    lap = MeasuredLap.objects.get()
    assert (lap.time_ms, lap.off_tracks) == (900, 1) and TimedSession.objects.get().ended_at
    assert not keeper.wrong
    keeper.context.close()


def test_a_slow_answer_does_not_pile_up_requests_for_the_laps_of_a_sensor(browser, live_server, race):
    make_sensor(race=race, name="Gate", by=race.organiser, now=timezone.now())
    keeper = Keeper(browser, live_server, race.organiser)
    held = []
    keeper.context.route(re.compile(r"/sessions/[^/]+/$"), lambda route: held.append(route))
    keeper.page.get_by_label("Timed").select_option(label="Gate")
    keeper.start()
    keeper.all_sent()
    keeper.drive(3500)
    assert len(held) == 1
    held.pop().abort()
    keeper.drive(1500)
    assert len(held) == 1, "asked again once the first request has failed"
    keeper.context.close()


def test_a_second_tab_takes_no_times(keeper):
    other = keeper.context.new_page()
    other.goto("/races/hall-race/timing/")
    expect(other.locator("[data-part=blocked]")).to_contain_text("open in another tab")
    expect(other.get_by_role("button", name=re.compile("^Start"))).to_be_disabled()


def test_everything_is_large_enough_for_a_thumb_at_360_px(browser, live_server, race):
    keeper = Keeper(browser, live_server, race.organiser, viewport={"width": 360, "height": 740}, has_touch=True)
    keeper.start()
    for button in keeper.page.locator("[data-do]").all():
        box = button.bounding_box()
        assert box["height"] >= 48 and box["width"] >= 120 and box["x"] + box["width"] <= 360
        words = button.evaluate(WORDS)
        assert 0 < words["height"] <= 60, "its words stand in a line or two"
        assert box["x"] <= words["left"] and words["right"] <= box["x"] + box["width"]
    assert keeper.page.evaluate("document.documentElement.scrollWidth") <= 360
    keeper.drive()
    keeper.page.get_by_role("button", name=re.compile("^Lap")).tap()
    expect(keeper.page.locator("[data-part=laps] tr")).to_have_count(1)
    keeper.context.close()
