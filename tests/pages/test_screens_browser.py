"""Screens of a live event in a real browser: spectators, a phone, the big screen, overlays, the commentator."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from races.live.services import crown, end_live, launch, prepare_ahead, set_message, tick_live
from races.live.services.show import MOST_IN_A_WINDOW
from races.models import LiveEvent, LiveReaction, LiveSlot, Race
from races.models.live import REVEALED_AFTER
from tests.clients import logged_in
from tests.duels import drawn, end_all
from tests.evaluation.stubs import HEADER
from tests.factories import a_racer, break_down, lap, outcome, start
from tests.live_shows import a_live_race, a_show, begun, slot_of
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.soak import only

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
LAP_MS = {"bob": 6_200, "carl": 5_900, "dora": 6_050}
OVERLAYS = {"tower": (480, 800), "clock": (640, 200), "lower-third": (1200, 220), "next": (480, 320)}
LATE_MS = 20_000
SHOTS = os.environ.get("PADDOCK_TEST_SHOTS", "")  # a folder, for who wants to look


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def keep(page, name: str, **options) -> bytes:
    shot = page.screenshot(**options)
    if SHOTS:
        Path(SHOTS, f"{name}.png").write_bytes(shot)
    return shot


def round_the_track(track: TrackGeometry, lap_ms: int, laps: int) -> bytes:
    rows, steps = [], round(lap_ms / (1000 / 15))
    for step in range(steps * laps):
        x, y = track.centre[step % steps * len(track.centre) // steps]
        where = f"{step // steps},{step},{x:.4f},{y:.4f},0.0,12.0,1.5,1,0.0,False,True,1.0,1,20.0"
        rows.append(f"{where},{step / 15},in_progress,0,0,0.0")
    return "\n".join([HEADER, *rows, ""]).encode()


def compute(event: LiveEvent, laps: int = 9) -> None:
    prepare_ahead(event=event, now=timezone.now())
    for slot in LiveSlot.objects.filter(event=event, evaluation__sealed=True, evaluation__state="queued"):
        lap_ms = LAP_MS[slot.racer.entry.racer.alias]
        run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), timezone.now())
        driven = [{**lap(number, lap_ms), "start_ms": lap_ms * (number - 1)} for number in range(1, laps + 1)]
        told = replace(outcome(driven), trace_csv=round_the_track(event.race.track.geometry, lap_ms, laps))
        assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=timezone.now())


def shown(event: LiveEvent, alias: str) -> None:
    """A run that is over: it began long enough ago."""
    compute(event)
    now, slot = timezone.now(), slot_of(event, alias)
    launch(event=event, slot=slot, by=event.race.organiser, seen=None, now=now - timedelta(minutes=2))
    tick_live(now=now)
    slot.refresh_from_db()
    assert slot.state == "done"


def on_track(event: LiveEvent, alias: str, since_s: float) -> None:
    compute(event)
    then = timezone.now() - timedelta(seconds=10 + since_s)
    launch(event=event, slot=slot_of(event, alias), by=event.race.organiser, seen=None, now=then)


@pytest.fixture
def event(browser, wakes) -> LiveEvent:
    now, alice = timezone.now(), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night", sponsor="Gear & Grip")
    return a_show(now, alice, list(LAP_MS), race=race, order="as_entered")


def test_every_screen_while_a_run_is_played(browser, live_server, event):
    from playwright.sync_api import expect

    alice, wrong = event.race.organiser, []
    begun(event, alice, timezone.now())
    set_message(event=event, message="Dinner is at eight.", by=alice, seen=None, now=timezone.now())
    shown(event, "bob")
    compute(event)
    on_track(event, "carl", 6.5)

    def is_fault(line) -> bool:
        return line.type == "error" and "status of 429" not in line.text  # the ninth reaction, which is refused

    def opened(path: str, **options):
        page = visitor(browser, live_server.url, **options).new_page()
        page.on("pageerror", lambda error: wrong.append(f"{path}: {error}"))
        page.on("console", lambda line: wrong.append(f"{path}: {line.text}") if is_fault(line) else None)
        page.asked = []
        page.on("request", lambda request: page.asked.append(request.url) if "frames.png" in request.url else None)
        page.goto(f"/races/race-night/{path}")
        return page

    big = opened("live/screen/", viewport={"width": 1920, "height": 1080})
    expect(big.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    expect(big.locator("[data-who]")).to_have_text("carl")
    expect(big.locator(".replay-car.ghost")).to_be_visible(timeout=LATE_MS)
    expect(big.locator("[data-tower] li")).to_have_count(3)
    expect(big.locator("[data-message]")).to_have_text("Dinner is at eight.")
    expect(big.get_by_text("Gear & Grip")).to_be_visible()
    assert big.locator("svg.qr path").count() == 1
    assert big.locator("a, button, input").count() == 0, "a screen has no controls"
    # readable from the back of a room: names a hundredth of the height at least, twice that for who drives
    assert big.locator("[data-tower] .who").first.evaluate("e => parseFloat(getComputedStyle(e).fontSize)") >= 32
    assert big.evaluate(
        "document.documentElement.scrollHeight <= innerHeight && document.body.scrollHeight <= innerHeight"
    )
    big.wait_for_function(
        """() => {
          (window.places ??= new Set()).add(document.querySelector('[data-car="0"]').style.transform);
          return window.places.size > 10;
        }"""
    )
    keep(big, "big-run-light")

    expect(big.locator("[data-tower] .who").first).to_have_text("carl")  # by the lap that is complete already

    watching = opened("event/", viewport={"width": 1280, "height": 900}, color_scheme="dark")
    expect(watching.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    expect(watching.locator("[data-sectors] li").first).to_be_visible(timeout=LATE_MS)
    assert watching.locator("[data-sectors] li").first.get_attribute("class") in ("best", "own", "slow")
    sees(watching)
    keep(watching, "spectator-dark", full_page=True)

    for piece, (width, height) in OVERLAYS.items():
        page = opened(f"live/overlay/{piece}/", viewport={"width": width, "height": height})
        expect(page.locator(".air-box")).to_be_visible(timeout=LATE_MS)
        if piece in ("clock", "lower-third"):
            expect(page.locator("[data-clock], [data-speed]").first).to_contain_text(".", timeout=LATE_MS)
        shot = keep(page, f"overlay-{piece}", omit_background=True)
        assert alpha_at_corner(page, shot) == 0, f"{piece}: the ground is transparent"
        assert page.context.cookies() == []

    phone = opened("live/phone/", viewport={"width": 360, "height": 740}, reduced_motion="reduce")
    expect(phone.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    assert phone.evaluate("document.documentElement.scrollWidth <= 360")
    phone.get_by_role("button", name="applause").click()
    expect(phone.locator('[data-count="clap"]')).to_have_text("1")
    assert LiveReaction.objects.get().count == 1
    keep(phone, "phone-light")
    sees(phone)
    assert phone.evaluate("document.documentElement.scrollWidth <= 360")
    keep(phone, "phone-sees-light", full_page=True)
    # at once, and more than two windows of time take: a slow machine sends some of them in the next one
    button = phone.get_by_role("button", name="applause")
    button.evaluate("(button, times) => { for (let i = 0; i < times; i++) button.click(); }", 2 * MOST_IN_A_WINDOW + 1)
    expect(phone.locator("[data-refused]")).to_contain_text("Wait ten seconds.")
    wrong[:] = [line for line in wrong if "429" not in line]

    telling = opened("live/commentary/", viewport={"width": 1280, "height": 900})
    expect(telling.locator("#told")).to_contain_text("carl is on track, round 1.")
    expect(telling.locator("#told")).to_contain_text("bob sets the first time: 6.200 s.")
    keep(telling, "commentary-light", full_page=True)

    # the tower's order after the reveal: carl is faster
    LiveSlot.objects.filter(pk=slot_of(event, "carl").pk).update(ends_at=timezone.now() - REVEALED_AFTER)
    tick_live(now=timezone.now())
    assert slot_of(event, "carl").state == "done"
    expect(big.locator("[data-tower] .who").first).to_have_text("carl", timeout=LATE_MS)
    expect(telling.locator("#told")).to_contain_text("New leader: carl, before bob.", timeout=LATE_MS)
    assert not wrong


def sees(page) -> None:
    """Who opens it sees what the car sees, with what it commands; who does not asks for nothing of it."""
    from playwright.sync_api import expect

    assert page.asked == []
    page.locator("[data-frames] summary").click()
    page.wait_for_function(
        """() => {
          const canvas = document.querySelector(".seen-cars canvas");
          const drawn = canvas && canvas.getContext("2d").getImageData(0, 0, 160, 120).data;
          return drawn && drawn.some((value, at) => at % 4 === 0 && value > 0);
        }"""
    )
    expect(page.locator(".seen-cars figcaption")).to_have_text("12° · 1.5 m/s")
    expect(page.locator(".seen-cars canvas")).to_have_accessible_name("Camera view of carl")


def alpha_at_corner(page, shot: bytes) -> int:
    """How opaque the last pixel of a screenshot is."""
    import io

    from PIL import Image

    picture = Image.open(io.BytesIO(shot)).convert("RGBA")
    return picture.getpixel((picture.width - 1, 1))[3]


@pytest.mark.parametrize("theme", only(["dark"], ["dark", "light"]))
def test_the_big_screen_before_and_after(browser, live_server, event, theme):
    from playwright.sync_api import expect

    page = visitor(browser, live_server.url, viewport={"width": 3840, "height": 2160}).new_page()
    page.goto(f"/races/race-night/live/screen/?theme={theme}")
    expect(page.locator("[data-countdown]")).to_contain_text("1:59:", timeout=LATE_MS)
    assert page.locator("[data-countdown]").evaluate("e => parseFloat(getComputedStyle(e).fontSize)") > 400
    keep(page, f"big-before-{theme}")
    now, alice = timezone.now(), event.race.organiser
    begun(event, alice, now)
    for alias in LAP_MS:
        shown(event, alias)
    crown(event=event, entry=slot_of(event, "carl").racer.entry, by=alice, seen=None, now=now)
    end_live(event=event, by=alice, seen=None, now=timezone.now())
    expect(page.locator("[data-podium] li .name")).to_have_text(["carl", "dora", "bob"], timeout=LATE_MS)
    expect(page.locator(".big-podium")).to_be_visible()
    keep(page, f"big-podium-{theme}")


def test_a_bracket_fills_itself(browser, live_server, wakes):
    from playwright.sync_api import expect

    now = timezone.now()
    race = drawn(now - timedelta(hours=2), 8, slug="knock-out", name="Knock-out", duel_format="bracket", duel_cars=2)
    page = visitor(browser, live_server.url, viewport={"width": 1920, "height": 1080}).new_page()
    page.goto("/races/knock-out/live/screen/")
    expect(page.locator(".bracket-tie").first).to_be_visible()
    assert page.locator(".bracket-car.won").count() == 0
    end_all(race, now)
    expect(page.locator(".bracket-car.won").first).to_be_visible(timeout=LATE_MS)
    keep(page, "bracket-screen")
    page.set_viewport_size({"width": 1600, "height": 900})
    page.goto("/races/knock-out/live/overlay/bracket/")
    keep(page, "overlay-bracket", omit_background=True)


LONG = "The autumn meeting of all schools and clubs of the northern region, final night"


def test_the_big_screen_cuts_nothing_and_moves_while_a_car_drives(browser, live_server, event):
    from playwright.sync_api import expect

    alice = event.race.organiser
    Race.objects.filter(pk=event.race_id).update(name=LONG[:64], sponsor="Gear and Grip Racing Supplies International")
    LiveEvent.objects.filter(pk=event.pk).update(message="Dinner is at eight.")
    event.refresh_from_db()
    begun(event, alice, timezone.now())
    shown(event, "bob")
    compute(event)
    page = visitor(browser, live_server.url, viewport={"width": 1920, "height": 1080}).new_page()
    page.goto("/races/race-night/live/screen/")
    tower = page.locator("[data-tower] .who")
    expect(tower.first).to_have_text("bob", timeout=LATE_MS)
    on_track(event, "carl", 1)
    expect(page.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    for part in (".big-head h1", ".big-sponsor"):
        whole = page.locator(part).evaluate(
            "e => e.scrollWidth <= e.clientWidth && e.scrollHeight <= e.clientHeight + 2"
        )
        assert whole and page.locator(part).evaluate("e => e.getBoundingClientRect().right <= innerWidth"), part
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    keep(page, "big-long-name")
    area = page.locator(".big .viewer-stage").evaluate("e => e.clientWidth * e.clientHeight")
    assert area > 0.28 * 1920 * 1080, "even with a long name and a message"
    expect(tower.first).to_have_text("carl", timeout=30_000)  # by a lap of the run that is still on track
    assert page.evaluate("!!document.querySelector('[data-show]').screen.told.current")
    keep(page, "big-tower-moved")


def test_a_screen_shows_a_lost_connection(browser, live_server, event):
    from playwright.sync_api import expect

    page = visitor(browser, live_server.url, viewport={"width": 1920, "height": 1080}).new_page()
    page.goto("/races/race-night/live/screen/")
    expect(page.locator("[data-countdown]")).to_contain_text("1:59:", timeout=LATE_MS)
    pills = page.locator("[data-tower] li .time").evaluate_all("all => all.map(e => e.getBoundingClientRect().right)")
    assert len({round(right) for right in pills}) == 1, "what stands beside the names is aligned"
    expect(page.locator("[data-lost]")).to_be_hidden()
    page.context.set_offline(True)
    expect(page.locator("[data-lost]")).to_be_visible(timeout=LATE_MS)
    keep(page, "big-lost")
    page.context.set_offline(False)
    expect(page.locator("[data-lost]")).to_be_hidden(timeout=LATE_MS)


def test_no_message_stands_over_the_podium(browser, live_server, event):
    from playwright.sync_api import expect

    now, alice = timezone.now(), event.race.organiser
    Race.objects.filter(pk=event.race_id).update(prize="A helmet")
    Racer.objects.filter(alias="carl").update(team="Rockets")
    begun(event, alice, now)
    for alias in LAP_MS:
        shown(event, alias)
    set_message(event=event, message="Dinner is at eight.", by=alice, seen=None, now=timezone.now())
    end_live(event=event, by=alice, seen=None, now=timezone.now())
    crown(event=event, entry=slot_of(event, "carl").racer.entry, by=alice, seen=None, now=now)
    page = visitor(browser, live_server.url, viewport={"width": 1920, "height": 1080}).new_page()
    page.goto("/races/race-night/live/screen/")
    expect(page.locator(".big-podium")).to_be_visible(timeout=LATE_MS)
    expect(page.locator("[data-message]")).to_be_hidden()
    expect(page.locator(".podium-picture")).to_have_count(3)
    expect(page.get_by_text("Rockets")).to_be_visible()
    expect(page.get_by_text("A helmet")).to_be_visible()
    keep(page, "big-podium-cards")


def test_a_run_without_a_result_says_so(browser, live_server, event):
    from playwright.sync_api import expect

    alice = event.race.organiser
    begun(event, alice, timezone.now())
    bob = slot_of(event, "bob")
    break_down(Evaluation.with_sealed.get(pk=bob.evaluation_id), UserFault("policy_memory", limit_mb=5), timezone.now())
    shown(event, "bob")
    guest = visitor(browser, live_server.url, viewport={"width": 1920, "height": 1080}).new_page()
    guest.goto("/races/race-night/live/screen/")
    row = guest.locator("[data-tower] li", has_text="bob")
    expect(row.locator(".time")).to_have_text("no result", timeout=LATE_MS)
    expect(guest.locator("[data-tower] li", has_text="carl").locator(".time")).to_have_text("–")
    keep(guest, "big-no-result")
    guest.goto("/races/race-night/event/")
    expect(guest.locator("tr", has_text="bob")).to_contain_text("no result")
    context = visitor(browser, live_server.url, viewport={"width": 360, "height": 800})
    cookie = logged_in(alice).cookies["sessionid"].value
    context.add_cookies([{"name": "sessionid", "value": cookie, "url": live_server.url}])
    console = context.new_page()
    console.goto("/races/race-night/event/console/")
    said = console.locator(".console-slot", has_text="bob")
    expect(said).to_contain_text("no result: The network needed more than 5 MB of memory.")
    keep(console, "console-no-result", full_page=True)


def test_the_console_shows_the_lamp_of_a_connected_screen(browser, live_server, event):
    from playwright.sync_api import expect

    screen = visitor(browser, live_server.url).new_page()
    screen.goto("/races/race-night/live/screen/")
    expect(screen.locator("[data-countdown]")).to_contain_text("1:59:", timeout=LATE_MS)
    context = visitor(browser, live_server.url, viewport={"width": 1280, "height": 900})
    client = logged_in(event.race.organiser)
    cookie = client.cookies["sessionid"].value
    context.add_cookies([{"name": "sessionid", "value": cookie, "url": live_server.url}])
    page = context.new_page()
    page.goto("/races/race-night/event/console/")
    expect(page.locator("#screens .lamp.on")).to_have_count(1, timeout=20_000)
    keep(page, "console-screens", full_page=True)
    page.set_viewport_size({"width": 360, "height": 800})
    keep(page, "console-screens-360", full_page=True)
