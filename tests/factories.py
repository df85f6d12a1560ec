"""Laps, races and results that a test chooses, taken through the real services of the queue."""

from __future__ import annotations

import hashlib
import itertools
import uuid
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any
from unittest.mock import patch

from accounts.models import Racer
from evaluation.models import Evaluation, State
from evaluation.running.pipeline import EvaluationOutcome
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from paddock.errors import PaddockError
from paddock.simulator import engine
from races.entries.services.submissions import submit_model
from races.models import Race, RaceKind, Submission
from tests.evaluation.stubs import trace_csv
from tests.rows import model_row, track_row
from tracks.models import Track

_numbers = itertools.count(1)


def lap(
    number: int,
    time_ms: int = 10_000,
    *,
    complete: bool = True,
    sectors: Sequence[int] | None = None,
    off_tracks: int = 0,
    crashes: int = 0,
    resets: int = 0,
    percentage: int = 100,
) -> dict[str, Any]:
    """One lap as the simulator writes it."""
    third = time_ms // 3
    return {
        "number": number,
        "start_ms": 0,
        "time_ms": time_ms,
        "complete": complete,
        "off_tracks": off_tracks,
        "crashes": crashes,
        "resets": resets,
        "immobilised": 0,
        "reversals": 0,
        "sector_ms": list(sectors) if sectors is not None else [third, third, time_ms - 2 * third] * complete,
        "completion_percentage": 100 if complete else percentage,
        "status": "Lap complete" if complete else "Off track",
    }


def laps(*times: int, resets: int = 0) -> list[dict[str, Any]]:
    """Complete laps of these times in milliseconds; ``resets`` happened in the first."""
    return [lap(number, time, resets=resets if number == 1 else 0) for number, time in enumerate(times, 1)]


def a_track() -> Track:
    """The oval, whichever test asks first."""
    return Track.objects.filter(slug="oval").first() or track_row("oval")


def a_race(now: datetime, **fields: Any) -> Race:
    """A public community race on the oval, open from a day before ``now`` to a week after it."""
    number = next(_numbers)
    defaults: dict[str, Any] = {
        "kind": RaceKind.COMMUNITY,
        "slug": f"race-{number}",
        "name": f"Race {number}",
        "opens_at": now - timedelta(days=1),
        "closes_at": now + timedelta(days=7),
        "laps": 3,
        "minimum_laps": 3,
    }
    if "track" not in fields:
        defaults["track"] = a_track()
    return Race.objects.create(**(defaults | fields))


def a_racer(alias: str | None = None, **fields: Any) -> Racer:
    """A racer who cannot log in (making a password takes long)."""
    alias = alias or f"racer-{next(_numbers)}"
    return Racer.objects.create_user(alias, f"{alias}@example.org", None, **fields)


def a_model(owner: Racer, **fields: Any):
    """Another model in ``owner``'s garage, its network unlike any before."""
    number = next(_numbers)
    return model_row(owner, name=fields.pop("name", f"Car {number}"), onnx=f"network {number}".encode(), **fields)


def outcome(driven: Sequence[dict[str, Any]]) -> EvaluationOutcome:
    """What the pipeline returns for these laps, driven with the site's engine."""
    return EvaluationOutcome(
        laps=list(driven),
        end_reason="laps_done",
        simulated_ms=sum(one["time_ms"] for one in driven),
        steps=1,
        trace_csv=trace_csv(),
        trace_sha256=hashlib.sha256(repr(driven).encode()).hexdigest(),
        metrics={"metrics": []},
        engine=engine.ENGINE_ID,
        versions={},
        cpu_model="test",
        wall_s=0.1,
        shares={},
        peak_mb=1.0,
    )


def start(evaluation: Evaluation, now: datetime) -> Evaluation:
    """Give this very evaluation to a worker, whoever else waits."""
    changed = Evaluation.with_sealed.filter(pk=evaluation.pk, state=State.QUEUED).update(
        state=State.RUNNING,
        lease=uuid.uuid4(),
        leased_until=now + timedelta(seconds=30),
        attempt=evaluation.attempt + 1,
        started_at=now,
        not_before=None,
    )
    assert changed, "only a queued evaluation can be started"
    evaluation.refresh_from_db()
    return evaluation


def finish(submission: Submission, driven: Sequence[dict[str, Any]], now: datetime) -> None:
    """Let a submission's evaluation drive these laps to its end."""
    running = start(submission.evaluation, now)
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(driven), now=now)


def fail(submission: Submission, fault: PaddockError, now: datetime) -> None:
    """Let a submission's evaluation fail, as often as it takes until that is final."""
    break_down(submission.evaluation, fault, now)


def break_down(evaluation: Evaluation, fault: PaddockError, now: datetime) -> None:
    """Let it fail for good; by a fault of ours as one whose simulator ended every time while others passed."""
    with patch.object(EVALUATIONS, "fails_alone", lambda run, fault: True):
        while not evaluation.is_final:
            running = start(evaluation, now)
            assert EVALUATIONS.fail(pk=running.pk, lease=running.lease, fault=fault, now=now)
            evaluation.refresh_from_db()


def drive(race: Race, racer: Racer, driven: Sequence[dict[str, Any]], now: datetime) -> Submission:
    """Submit a new car and let it drive these laps."""
    submission = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
    finish(submission, driven, now)
    submission.refresh_from_db()
    return submission
