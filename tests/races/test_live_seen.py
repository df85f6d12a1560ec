"""What the cars of a live run see, for its spectators: each half second once it has passed, drawn once for all."""

from __future__ import annotations

import base64
import io
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from django.core.cache import cache
from django.urls import reverse
from django.utils import timezone
from PIL import Image

from evaluation.camera_replay.replay import CAMERA
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.simulator.camera.view import Scene
from paddock.simulator.retracing import RunSight, TracePath
from paddock.simulator.sensors import make_sensors
from races.live.services import launch
from races.live.streaming import camera as live_seen
from races.live.streaming.pose_chunks import cut
from races.models import Visibility
from tests.clients import logged_in
from tests.drawn_runs import driven_trace
from tests.factories import a_racer, lap, outcome, start
from tests.live_shows import a_live_race, a_show, begun, slot_of

pytestmark = pytest.mark.django_db
PLAYED_S = 3
LAP_MS = 9_000


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def played(now, wakes):
    """A run of 18 s, computed ahead and on track for three; and its trace."""
    cache.clear()
    alice = a_racer("alice")
    event = begun(a_show(now, alice, ["bob"], race=a_live_race(now, alice, slug="night")), alice, now)
    slot = slot_of(event, "bob")
    run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), now)
    driven = [{**lap(number, LAP_MS), "start_ms": LAP_MS * (number - 1)} for number in (1, 2)]
    trace = driven_trace(event.race.track, 2, LAP_MS)
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=replace(outcome(driven), trace_csv=trace), now=now)
    launch(event=event, slot=slot, by=alice, seen=None, now=now - timedelta(seconds=10 + PLAYED_S))
    slot.refresh_from_db()
    return slot, trace


def frames(slot, n, racer=None):
    return logged_in(racer).get(reverse("live_frames", args=[slot.event.race.slug]), {"slot": slot.pk, "n": n})


def test_frames_come_once_its_half_second_has_passed(played, now, monkeypatch):
    slot, _trace = played
    monkeypatch.setattr(timezone, "now", lambda: now)
    last = PLAYED_S * 2 - 1
    answer = frames(slot, last)
    assert answer.status_code == 200 and answer["Content-Type"] == "image/png"
    width, height = Image.open(io.BytesIO(answer.content)).size
    assert (width, height) == (3 * 160, 120), "five frames a second"
    for n in (last + 1, 30, 9999, "", "x", "-1"):
        assert frames(slot, n).status_code == 404, n
    monkeypatch.setattr(timezone, "now", lambda: now + timedelta(milliseconds=501))
    assert frames(slot, last + 1).status_code == 200


def test_of_a_run_that_was_not_launched_there_is_none(played):
    slot, _trace = played
    type(slot).objects.filter(pk=slot.pk).update(state="waiting", starts_at=None, ends_at=None)
    assert frames(slot, 0).status_code == 404


def test_its_frames_are_those_of_the_run(played):
    slot, trace = played
    drawn = np.array(Image.open(io.BytesIO(frames(slot, 2).content)))
    path, track = TracePath.of(trace), slot.event.race.track.geometry
    steps = [step for step, ms in enumerate(path.ms) if 1000 <= ms < 1500][:: live_seen.EVERY]
    camera = make_sensors(CAMERA, lambda: Scene.of(track))
    for place, step in enumerate(steps):
        (frame,) = RunSight(path).readings(step, camera).values()
        assert (drawn[:, 160 * place : 160 * (place + 1)] == frame[:, :, 0]).all(), step
    assert drawn.shape == (120, 160 * len(steps)) and len(steps) > 1


def test_a_crash_is_told_of_in_the_lap_in_which_it_happened():
    """Counted from one, as its laps are."""
    columns = {name: [0.0, 0.0, 0.0] for name in ("x", "y", "yaw", "v", "steer", "progress")}
    car = {
        "number": 0,
        "t": [0, 66, 133],
        "lap": [1, 1, 2],
        "status": ["in_progress", "crashed", "off_track"],
        **columns,
    }
    (chunk,) = cut([car], [], {0: []})
    assert [(event["kind"], event["lap"]) for event in chunk["events"]] == [("crashed", 1), ("off_track", 2)]


def test_it_is_drawn_once_for_all_who_look(played, monkeypatch):
    slot, _trace = played
    draws, draw = [], live_seen._drawn
    monkeypatch.setattr(live_seen, "_drawn", lambda *given: draws.append(given) or draw(*given))
    seen = {frames(slot, 1, racer).content for racer in (None, a_racer("carl"), a_racer("dora"))}
    assert len(draws) == len(seen) == 1


def test_while_others_are_drawn_for_too_long_there_is_none_to_wait_for(played, monkeypatch):
    slot, _trace = played
    monkeypatch.setattr(live_seen, "_WAIT_S", 0.01)
    with live_seen._drawing:
        answer = frames(slot, 1)
    assert (answer.status_code, answer.content) == (204, b"")
    assert frames(slot, 1).status_code == 200


def test_of_a_private_event_a_stranger_sees_nothing(played):
    slot, _trace = played
    type(slot.event.race).objects.filter(pk=slot.event.race_id).update(visibility=Visibility.INVITATION)
    for stranger in (None, a_racer("mallory")):
        assert frames(slot, 0, stranger).status_code == 404
    for insider in (slot.racer.entry.racer, slot.event.race.organiser, a_racer("stella", is_staff=True)):
        assert frames(slot, 0, insider).status_code == 200


def test_frames_of_a_public_event_may_be_kept_by_everybody(played):
    """A strip has a number, and what has passed stays as it was."""
    slot, _trace = played
    assert (
        frames(slot, 0)["Cache-Control"] == frames(slot, 0, a_racer("carl"))["Cache-Control"] == "public, max-age=600"
    )
    assert "max-age" not in frames(slot, 9999).get("Cache-Control", "")
    type(slot.event.race).objects.filter(pk=slot.event.race_id).update(visibility=Visibility.INVITATION)
    assert frames(slot, 0, slot.event.race.organiser)["Cache-Control"] == "private, max-age=600"


@pytest.fixture
def clock(now, monkeypatch):
    """The time, which a test moves on."""
    at = [now]
    monkeypatch.setattr(timezone, "now", lambda: at[0])
    return at


def told(feed):
    said, pause = feed.next()
    return [data["n"] for data in said], pause


def test_the_stream_tells_each_half_second_once_it_has_passed(played, now, clock):
    slot, _trace = played
    feed = live_seen.FrameFeed(str(slot.event.race_id))
    (first,), pause = feed.next()
    assert (first["slot"], first["n"]) == (slot.pk, PLAYED_S * 2 - 1)
    assert base64.b64decode(first["png"]) == frames(slot, PLAYED_S * 2 - 1).content
    assert pause == pytest.approx(0.53)
    clock[0] = now + timedelta(milliseconds=499)
    assert told(feed)[0] == [], "not before its time"
    clock[0] = now + timedelta(milliseconds=501)
    assert told(feed)[0] == [PLAYED_S * 2]
    clock[0] = now + timedelta(seconds=3)
    assert told(feed)[0] == [10, 11], "who is late goes on with the newest"
    clock[0] = now + timedelta(seconds=30)
    assert told(feed)[0] == [], "after the last there is none"


def test_the_stream_tells_nothing_of_a_run_that_is_not_played(played, clock):
    slot, _trace = played
    for state in ("waiting", "called"):
        type(slot).objects.filter(pk=slot.pk).update(state=state, starts_at=None, ends_at=None)
        assert told(live_seen.FrameFeed(str(slot.event.race_id))) == ([], live_seen.RARELY_S)
    assert told(live_seen.FrameFeed("x")) == told(live_seen.FrameFeed("9" * 40)) == ([], 5.0)


def test_what_is_too_large_for_a_stream_is_named_only(played, clock, monkeypatch):
    slot, _trace = played
    monkeypatch.setattr(live_seen, "MOST_BYTES", 10)
    (data,), _pause = live_seen.FrameFeed(str(slot.event.race_id)).next()
    assert data == {"slot": slot.pk, "n": PLAYED_S * 2 - 1}


def test_while_others_draw_the_stream_goes_on(played, clock, monkeypatch):
    slot, _trace = played
    monkeypatch.setattr(live_seen, "STREAM_WAIT_S", 0.01)
    with live_seen._drawing:
        assert told(live_seen.FrameFeed(str(slot.event.race_id)))[0] == []
