"""Parts of pages that renew themselves, in a real browser: focus stays, what is new is said, a run is played out;
and the wizard says what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timedelta

import pytest
from django.utils import timezone

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.submissions import submit_model
from races.models import Race
from tests.drawn_runs import a_driven_run, driven_trace
from tests.factories import a_model, a_race, a_racer, laps, outcome, start
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from training.models import TrainingJob
from training.vehicles.services import save_vehicle
from videos import drawing
from videos.services import request_video, run_next_video

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
# every message of the polite region and every start of the player, from the moment that the page is there
RECORD = """addEventListener("DOMContentLoaded", () => {
  window.messages = []; window.plays = 0;
  new MutationObserver((changes) => changes.forEach(({ target, attributeName }) => {
    if (attributeName === "data-plays") window.plays += target.hasAttribute("data-plays");
    else if (target.closest && target.closest("[data-live-said]")) window.messages.push(target.textContent);
  })).observe(document, { subtree: true, childList: true, attributes: true });
});"""
LAP_MS = 1_000
CARD_S = 2.5  # the figures at the end of a video
WRITE_VIDEO, POSTER = drawing.write_video, drawing.poster  # before a test puts others in their place


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def now(browser, wakes, video_wakes, trainings_taken_on) -> datetime:
    return timezone.now()


def on_track(race: Race, racer, now: datetime) -> Evaluation:
    """A car of the racer that a worker has begun to drive."""
    evaluation = start(submit_model(race=race, racer=racer, model=a_model(racer), now=now).evaluation, now)
    drives(evaluation, 1)
    return evaluation


def drives(evaluation: Evaluation, lap: int) -> None:
    progress = {"lap": lap, "laps": 3, "lap_ms": 4_000, "total_ms": 10_000 * lap, "percent": 40.0, "x": 1.0, "y": 1.0}
    Evaluation.objects.filter(pk=evaluation.pk).update(progress=progress)


def finishes(evaluation: Evaluation, now: datetime) -> None:
    driven = outcome(laps(*[LAP_MS] * 3))
    for number, lap in enumerate(driven.laps):
        lap["start_ms"] = LAP_MS * number
    driven = replace(driven, trace_csv=driven_trace(evaluation.track, 3, LAP_MS))
    assert finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=driven, now=now)


def said(page, words: str) -> None:
    page.wait_for_function("words => window.messages.some((each) => each.includes(words))", arg=words)


def test_the_live_card_keeps_the_focus_and_announces_changes(browser, live_server, now) -> None:
    race, alice = a_race(now, slug="watched", name="Watched"), a_racer("alice")
    evaluation = on_track(race, alice, now)
    page = visitor(browser, live_server.url, alice).new_page()
    page.add_init_script(RECORD)
    page.goto("/races/watched/")
    page.locator("#live-card a").focus()
    page.evaluate("window.focused = document.activeElement")
    kept = "window.focused === document.activeElement && window.focused.isConnected"
    drives(evaluation, 2)
    said(page, "On track, lap 2 of 3.")
    assert page.evaluate(kept)
    finishes(evaluation, now)
    said(page, "Finished, best lap 0:01.000.")
    said(page, "alice: 0:01.000.")  # the board's row, which may be the later of the two
    page.locator("#live-card .pill.finished").wait_for()
    assert page.evaluate(kept)

    # however much happens at once: one message, and the next after a pause
    page.evaluate(
        """async () => {
          const tell = (text) => {
            document.getElementById("live-card").dataset.say = text;
            document.dispatchEvent(new CustomEvent("htmx:afterSettle"));
          };
          window.messages = [];
          tell("one"); tell("two");
          while (!window.messages.length) await new Promise(requestAnimationFrame);
          tell("three"); tell("four");
        }"""
    )
    said(page, "four")
    assert page.evaluate("window.messages") == ["two", "four"]


def test_a_finished_run_plays_by_itself_then_shows_its_result(browser, live_server, now) -> None:
    race, alice = a_race(now), a_racer("alice")
    for motion in ("no-preference", "reduce"):
        evaluation = on_track(race, alice, now)
        page = visitor(browser, live_server.url, alice, reduced_motion=motion).new_page()
        page.add_init_script(RECORD)
        page.goto(evaluation.get_absolute_url())
        page.get_by_role("button", name="Stop").focus()
        drives(evaluation, 2)
        said(page, "On track, lap 2 of 3.")
        assert page.evaluate("document.activeElement.textContent") == "Stop"
        finishes(evaluation, now)
        page.locator("[data-landed]").wait_for()
        assert page.evaluate("window.plays") == (1 if motion == "no-preference" else 0)
        assert page.locator("[data-out]").text_content() == "Finished, best lap 0:01.000."
        assert page.locator("[data-seek]").input_value() == page.locator("[data-seek]").get_attribute("max")
        assert page.locator("[data-rate]").input_value() == "1"
        said(page, "Finished, best lap 0:01.000.")
        assert page.evaluate("document.querySelector('#evaluation').contains(document.activeElement)"), "not on BODY"
        page.reload()
        page.locator("[data-player]").wait_for()
        assert page.evaluate("window.plays") == 0, "only for who has watched"


def test_a_replay_is_controlled_from_the_keyboard(browser, live_server, now) -> None:
    alice = a_racer("alice")
    run = a_driven_run(a_race(now), alice, now, lap_ms=4_000)
    page = visitor(browser, live_server.url, alice).new_page()
    page.goto(run.get_absolute_url())
    page.get_by_role("button", name="Play").focus()
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.activeElement.textContent === 'Pause'")
    page.wait_for_function("() => !document.querySelector('[data-out]').textContent.includes('0:00.000 ')")
    page.keyboard.press("Enter")
    seek = page.get_by_label("Time of the replay")
    seek.focus()
    page.keyboard.press("Home")  # a busy machine may have played it to its end
    before = int(seek.input_value())
    page.keyboard.press("End")
    assert int(seek.input_value()) > before
    assert "translate(" in page.locator('[data-car="0"]').get_attribute("style")


def test_video_progress_is_announced_and_its_button_keeps_focus(browser, live_server, now) -> None:
    alice = a_racer("alice")
    run = a_driven_run(a_race(now), alice, now)
    video = request_video(evaluation=run, by=alice, car=0, part="best", language="en", now=now).video
    video.state, video.progress, video.attempt = "drawing", 12, 1
    video.lease, video.leased_until = "12345678123456781234567812345678", now + timedelta(minutes=5)
    video.started_at = now
    video.save()
    page = visitor(browser, live_server.url, alice).new_page()
    page.add_init_script(RECORD)
    page.goto(run.get_absolute_url())
    page.locator("#video-now button").focus()
    type(video).objects.filter(pk=video.pk).update(progress=57)
    said(page, "Video: 50 per cent rendered.")
    assert page.evaluate("document.activeElement.closest('#video-now') !== null")
    page.keyboard.press("Enter")
    page.locator("#video:not(:has(#video-now))").wait_for()
    page.wait_for_function("() => document.querySelector('#video').contains(document.activeElement)")


def test_a_drawn_video_is_played_and_jumped_about_in(browser, live_server, now, monkeypatch) -> None:
    """Of a lap of a second; of a real run, drawn by a worker of a whole site: tests/pages/test_video_browser.py."""
    monkeypatch.setattr(drawing, "write_video", WRITE_VIDEO)
    monkeypatch.setattr(drawing, "poster", POSTER)
    alice = a_racer("alice")
    run = a_driven_run(a_race(now), alice, now)
    page = visitor(browser, live_server.url, alice).new_page()
    page.goto(run.get_absolute_url())
    page.locator("#video").get_by_role("button", name="Make a video").click()
    page.locator("#video").get_by_role("progressbar").wait_for()
    assert run_next_video(worker="w")
    page.locator("#video video").wait_for()
    page.wait_for_function("() => document.querySelector('#video video').readyState >= 1")
    player = page.locator("#video video")
    assert player.evaluate("video => video.duration") == pytest.approx(0.999 + CARD_S, abs=0.1)
    assert player.evaluate("video => video.videoWidth") == 1280
    player.evaluate("video => { video.muted = true; return video.play(); }")
    player.evaluate("video => { video.currentTime = 2.0; }")
    page.wait_for_function("() => document.querySelector('#video video').currentTime > 2.2")
    assert player.evaluate("video => video.error && video.error.message") is None
    with page.expect_download() as download:
        page.locator("#video").get_by_role("link", name="Download (MP4").click()
    assert download.value.suggested_filename.endswith(".mp4")

    guest = visitor(browser, live_server.url).new_page()
    guest.goto(page.url)
    guest.locator("#video video").wait_for()
    assert guest.locator("#video form").count() == 0


def test_the_wizard_shows_errors_and_defaults_to_the_original_car(browser, live_server, now) -> None:
    from tests.factories import a_track

    a_track()
    alice = a_racer("alice")
    save_vehicle(owner=alice, name="Buggy", sensors=["STEREO_CAMERAS"])
    page = visitor(browser, live_server.url, alice).new_page()
    page.goto("/train/new/")
    assert page.get_by_role("radio", name="The original car").is_checked()
    page.get_by_label("Name", exact=True).fill("Careful")
    editor = page.locator("[data-reward-editor]")
    editor.evaluate(
        "(element, text) => element.editor.fill(text)", "def reward_function(params):\n    return missing\n"
    )
    page.get_by_role("button", name="Create and train").click()
    summary = page.locator(".summary")
    summary.wait_for()
    assert page.evaluate("document.activeElement.className") == "fault summary"
    assert page.evaluate("document.activeElement.getBoundingClientRect().top >= 0 && scrollY < innerHeight")
    assert page.locator(".wrong-step a").all_inner_texts() == ["Reward function – to be corrected"]
    summary.get_by_role("link", name="Reward function").click()
    assert page.evaluate("document.activeElement.className") == "editor-host"

    # a value that the browser itself refuses, in a part that is closed
    page.locator("[name=lr]").evaluate("field => { field.value = '7'; }")
    page.get_by_role("button", name="Create and train").click()
    assert page.evaluate("document.activeElement.name") == "lr"
    page.locator("[name=lr]").fill("0.001")
    page.locator("[data-examples]").select_option(label="Follow the centre line")
    page.get_by_role("button", name="Create and train").click()
    page.get_by_text("Training queued.").wait_for()
    job = TrainingJob.objects.get()
    assert job.vehicle is None and job.sensors == ["FRONT_FACING_CAMERA"]
