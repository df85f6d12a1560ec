"""Reference laps are queued for raced tracks, driven when nothing else waits, and give medals."""

from __future__ import annotations

import gzip
import json
from datetime import timedelta
from types import SimpleNamespace

import pytest

from core.jobs.work import never
from evaluation.running.queue.services import queue_evaluation
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from tests.factories import a_race, a_racer
from tests.rows import model_row
from tracks.models import ReferenceLap, ReferenceState
from tracks.reference import jobs
from tracks.reference.jobs import REFERENCES, queue_references, run_next_reference
from tracks.reference.medals import Medal, medal_of, medal_times, next_medal
from tracks.reference.selectors import reference_lap, reference_ms
from tracks.services import load_catalogue

pytestmark = pytest.mark.django_db
FOUND = {"time_ms": 4000, "laps": [{"number": 1, "time_ms": 4000}], "trace": "X,Y\n1,2\n", "trace_sha256": "a" * 64}


@pytest.fixture
def queued(now) -> ReferenceLap:
    race = a_race(now)
    assert queue_references(now=now) == 1
    return ReferenceLap.objects.get(track=race.track)


@pytest.fixture
def driven(queued, monkeypatch) -> ReferenceLap:
    monkeypatch.setattr(jobs, "drive", lambda *asked: FOUND)
    assert run_next_reference(worker="w")
    queued.refresh_from_db()
    return queued


def test_a_raced_track_gets_one_reference_in_the_race_s_direction(queued, now):
    assert (queued.direction, queued.engine, queued.state) == ("ccw", ENGINE_ID, ReferenceState.QUEUED)
    assert queue_references(now=now) == 0
    a_race(now, track=queued.track, direction="cw")
    assert queue_references(now=now) == 1


def test_nothing_is_queued_for_tracks_without_a_race(now):
    load_catalogue(now=now)
    assert queue_references(now=now) == 0


def test_a_finished_reference_keeps_its_laps_and_trace(driven):
    assert (driven.state, driven.time_ms, driven.laps) == (ReferenceState.FINISHED, 4000, FOUND["laps"])
    assert gzip.decompress(bytes(driven.trace)).decode() == FOUND["trace"]
    assert reference_lap(driven.track, "ccw") == driven and reference_lap(driven.track, "cw") is None
    assert reference_ms(driven.track_id, "ccw") == 4000 and reference_ms(driven.track_id, "ccw", "older") is None


def test_a_reference_waits_while_a_run_waits(queued, now, monkeypatch):
    monkeypatch.setattr(jobs, "drive", lambda *asked: pytest.fail("it was driven"))
    racer = a_racer("gina")
    queue_evaluation(owner=racer, model=model_row(racer), track=queued.track, rules=RaceRules(), now=now)
    assert not run_next_reference(worker="w")


def test_a_reference_makes_way_for_a_run_and_keeps_its_place(queued, now, monkeypatch):
    def drive(track, direction, should_stop):
        assert not should_stop()
        racer = a_racer("gina")
        queue_evaluation(owner=racer, model=model_row(racer), track=track, rules=RaceRules(), now=now)
        assert should_stop()
        raise PlatformFault("reference_failed")

    monkeypatch.setattr(jobs, "drive", drive)
    assert run_next_reference(worker="w")
    queued.refresh_from_db()
    assert (queued.state, queued.attempt, queued.operator_detail) == (ReferenceState.QUEUED, 0, "")


def test_a_track_that_cannot_be_driven_fails_for_good(queued, now, monkeypatch):
    def drive(*asked):
        raise UserFault("reference_undrivable")

    monkeypatch.setattr(jobs, "drive", drive)
    assert run_next_reference(worker="w")
    queued.refresh_from_db()
    assert (queued.state, queued.reason_code) == (ReferenceState.FAILED, "reference_undrivable")
    assert queue_references(now=now) == 0 and not run_next_reference(worker="w")


def test_a_failing_process_is_tried_again_with_its_words_kept(queued, now, monkeypatch):
    monkeypatch.setattr(jobs, "_MODULE", "paddock.no_such_module")
    assert run_next_reference(worker="w")
    queued.refresh_from_db()
    assert queued.state == ReferenceState.QUEUED
    assert "no_such_module" in queued.operator_detail


@pytest.mark.slow
def test_the_process_answers_with_a_run_that_the_referee_accepted():
    track = SimpleNamespace(geometry=by_slug("oval").geometry())
    found = jobs.drive(track, "cw", never)
    assert found["time_ms"] == min(lap["time_ms"] for lap in found["laps"])
    assert [lap["complete"] for lap in found["laps"]] == [True] * 3
    assert found["trace"].startswith("episode,steps,X,Y")


def test_a_stopped_process_is_gone_at_once():
    track = SimpleNamespace(geometry=by_slug("h-track").geometry())
    with pytest.raises(PlatformFault) as stopped:
        jobs.drive(track, "ccw", lambda: True)
    assert stopped.value.code == "reference_failed"


def test_a_sweep_queues_what_races_ask_for(now):
    a_race(now)
    assert REFERENCES.sweep(now=now + timedelta(seconds=1), wake=False).waiting == 1


@pytest.mark.parametrize(
    ("time_ms", "medal"),
    [
        (9_999, Medal.AUTHOR),
        (10_000, Medal.GOLD),
        (10_500, Medal.GOLD),
        (10_501, Medal.SILVER),
        (11_500, Medal.SILVER),
        (11_501, Medal.BRONZE),
        (13_000, Medal.BRONZE),
        (13_001, None),
        (None, None),
    ],
)
def test_the_medal_of_a_lap(time_ms, medal):
    assert medal_of(time_ms, 10_000) == medal


def test_no_reference_no_medal():
    assert medal_of(1_000, None) is None


def test_the_next_medal_is_one_better():
    assert next_medal(None, 10_000) == (Medal.BRONZE, 13_000)
    assert next_medal(13_000, 10_000) == (Medal.SILVER, 11_500)
    assert next_medal(10_000, 10_000) == (Medal.AUTHOR, 9_999)
    assert next_medal(9_999, 10_000) is None
    assert json.dumps(medal_times(10_000)) == json.dumps(
        {"author": 9_999, "gold": 10_500, "silver": 11_500, "bronze": 13_000}
    )
