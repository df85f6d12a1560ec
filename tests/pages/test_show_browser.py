"""A live event in real browsers: an organiser, a racer and spectators, from the lobby to the podium."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta

import pytest
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.geometry.track import TrackGeometry
from races.entries.services.entries import enter_race
from races.live.services import choose_model, plan_live, prepare_ahead, show, tick_live
from races.models import LiveEvent, LiveSlot
from tests.evaluation.stubs import HEADER
from tests.factories import a_model, a_racer, lap, outcome, start
from tests.live_shows import a_live_race
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
LAP_MS = {"bob": 2_900, "carl": 12_000, "dora": 3_050}
LATE_MS = 20_000


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def event(browser, monkeypatch: pytest.MonkeyPatch, wakes) -> LiveEvent:
    monkeypatch.setattr(show, "COUNTDOWN", timedelta(seconds=3))
    now, alice = timezone.now(), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    planned = plan_live(
        race=race, by=alice, now=now, starts_at=now + timedelta(minutes=10), rounds=1, order="as_entered"
    )
    for name in LAP_MS:
        racer = a_racer(name)
        enter_race(race=race, racer=racer, now=now)
        if name != "bob":
            choose_model(event=planned, racer=racer, model=a_model(racer), now=now)
    a_model(Racer.objects.get(alias="bob"), name="Lightning")
    return planned


def compute(event: LiveEvent) -> None:
    """What a worker does: every sealed run that waits drives a lap round the track."""
    prepare_ahead(event=event, now=timezone.now())
    for slot in LiveSlot.objects.filter(event=event, evaluation__sealed=True, evaluation__state="queued"):
        lap_ms = LAP_MS[slot.racer.entry.racer.alias]
        run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), timezone.now())
        told = replace(outcome([lap(1, lap_ms)]), trace_csv=round_the_track(event.race.track.geometry, lap_ms))
        assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=timezone.now())


def round_the_track(track: TrackGeometry, lap_ms: int) -> bytes:
    rows, steps = [], round(lap_ms / (1000 / 15))
    for step in range(steps):
        x, y = track.centre[step * len(track.centre) // steps]
        rows.append(f"0,{step},{x:.4f},{y:.4f},0.0,0.0,1.5,1,0.0,False,True,1.0,1,20.0,{step / 15},in_progress,0,0,0.0")
    return "\n".join([HEADER, *rows, ""]).encode()


def play(event: LiveEvent, page, alias: str) -> None:
    """Until the run on track is over and revealed, as the clock and browsers do it."""
    for _ in range(300):
        tick_live(now=timezone.now())
        if LiveSlot.objects.filter(event=event, racer__entry__racer__alias=alias, state="done").exists():
            return
        page.wait_for_timeout(100)
    pytest.fail(f"the run of {alias} was not played to its end")


def test_from_the_lobby_to_the_podium(browser, live_server, event):
    from playwright.sync_api import expect

    alice, bob = Racer.objects.get(alias="alice"), Racer.objects.get(alias="bob")
    wrong: list[str] = []

    def window(racer=None, **options):
        page = visitor(browser, live_server.url, racer, **options).new_page()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
        return page

    racing, organising, watching = window(bob), window(alice), window()
    phone = window(viewport={"width": 360, "height": 740})
    # a clock that is wrong by a day
    phone.add_init_script("const real = Date.now; Date.now = () => real() + 86400000;")
    address = "/races/race-night/event/"

    LiveEvent.objects.update(lobby_opens_at=timezone.now() - timedelta(minutes=1))
    racing.goto(address)
    racing.get_by_label("Model").select_option(label="Lightning")
    racing.get_by_role("button", name="Drive with it").click()
    racing.get_by_role("button", name="I am here").click()
    expect(racing.locator("#live-side")).to_contain_text("You are here.")
    for page in (watching, phone):
        page.goto(address)
        expect(page.locator("#live-parts")).to_contain_text("The lobby is open")

    organising.goto(f"{address}console/")
    organising.get_by_role("button", name="Begin").click()
    compute(event)
    # by keyboard: bob from the first place to the second
    organising.reload()
    organising.get_by_role("button", name="Move bob down").press("Enter")
    expect(organising.locator(".console-slot").first).to_contain_text("carl")
    for number, alias in enumerate(("carl", "bob", "dora"), 1):
        compute(event)
        organising.reload()
        organising.get_by_role("button", name=f"Launch {alias}").dblclick()
        expect(organising.locator(".console-slot.countdown, .console-slot.on_track")).to_contain_text(alias)
        expect(organising.get_by_text("Somebody did something")).to_have_count(0)
        expect(watching.locator("[data-who]")).to_have_text(alias, timeout=LATE_MS)
        expect(watching.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
        if number == 1:
            before = watching.locator('[data-car="0"]').get_attribute("style")
            expect(watching.locator('[data-car="0"]')).not_to_have_attribute("style", before, timeout=LATE_MS)
            assert_in_step(watching, phone)
            late = window()
            late.goto(address)
            expect(late.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
            assert_awake_after_an_hour(window(), address, watching)
        play(event, watching, alias)
        expect(watching.locator("#live-parts table")).to_contain_text(alias, timeout=LATE_MS)
    organising.reload()
    organising.get_by_role("button", name="End the event").click()
    podium = watching.locator(".show-podium li")
    expect(podium.first).to_have_text("bob", timeout=LATE_MS)
    assert podium.all_text_contents() == ["bob", "dora", "carl"]
    watching.goto("/races/race-night/")
    expect(watching.locator("table.board tbody tr").first).to_contain_text("bob")
    assert not wrong


def test_a_place_is_dragged(browser, live_server, event):
    from playwright.sync_api import expect

    from races.live.services import begin_live

    alice = Racer.objects.get(alias="alice")
    begin_live(event=event, by=alice, seen=None, now=timezone.now())
    page = visitor(browser, live_server.url, alice).new_page()
    page.goto("/races/race-night/event/console/")
    rows = page.locator(".console-slot")
    rows.nth(2).drag_to(rows.nth(0))
    expect(page.locator(".console-slot").first).to_contain_text("dora")
    assert LiveSlot.objects.order_by("position").first().racer.entry.racer.alias == "dora"


def assert_awake_after_an_hour(page, address: str, other) -> None:
    """A browser whose clock stood still for an hour is in step again within seconds."""
    from playwright.sync_api import expect

    hour_ms = 3_600_000

    def an_hour_before(route) -> None:
        answer = route.fetch()
        told = answer.json()
        route.fulfill(response=answer, json=told | {"now": told["now"] - hour_ms})

    page.route("**/stream/clock", an_hour_before)
    page.goto(address)
    says = "() => document.querySelector('[data-show]').show.clock.now()"
    page.wait_for_function("() => document.querySelector('[data-show]').show.clock.known")
    assert page.evaluate(says) < timezone.now().timestamp() * 1000 - hour_ms / 2
    page.unroute("**/stream/clock")
    page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")  # somebody opens the lid
    for _ in range(200):
        if abs(page.evaluate(says) - timezone.now().timestamp() * 1000) < 250:
            break
        page.wait_for_timeout(100)
    assert_in_step(page, other)
    expect(page.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)


def assert_in_step(one, other) -> None:
    """Two browsers play the same instant within half a second, whatever their own clocks say."""
    asked = "() => { const root = document.querySelector('[data-show]').show; return root.clock.now(); }"
    told = []
    for page in (one, other):
        before = timezone.now().timestamp() * 1000
        says = page.evaluate(asked)
        after = timezone.now().timestamp() * 1000
        told.append((says - before, says - after))
    for early, late in told:
        assert -250 < (early + late) / 2 < 250, told
