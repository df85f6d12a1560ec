"""What races and runs write down of what happens, and who may see it."""

from __future__ import annotations

import pytest

from core.events import Event
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import PlatformFault, UserFault
from races.duels.services import draw_duels, drive_on
from races.entries.services.entries import enter_race, withdraw
from races.entries.services.submissions import submit_model
from races.pages.services import cancel_race
from tests.duels import a_duel_race, end_all, qualify
from tests.factories import a_model, a_race, a_racer, drive, fail, laps

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def silent(wakes):
    return wakes


def happened(**which) -> list[tuple]:
    """Kind, racer and subject of what happened, in order."""
    return list(Event.objects.filter(**which).order_by("pk").values_list("kind", "racer__alias", "subject"))


def test_queueing_and_claiming_a_run_write_events(alice, now):
    submission = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now)
    assert EVALUATIONS.claim(worker="w", now=now) and EVALUATIONS.claim(worker="w", now=now) is None
    run = submission.evaluation.public_id
    assert happened() == [("run.queued", "alice", run), ("run.started", "alice", run)]
    assert Event.objects.get(kind="run.started").data == {"attempt": 1}


def test_a_counting_result_writes_its_events(alice, now):
    race = a_race(now)
    run = drive(race, alice, laps(9_000, 9_000, 9_000), now).evaluation
    assert [row for row in happened() if row[0] not in ("race.board", "run.queued")] == [
        ("run.finished", "alice", run.public_id),
        ("race.result", "alice", run.public_id),
    ]
    finished = Event.objects.get(kind="run.finished")
    assert (finished.at, finished.data) == (run.ended_at, {"best_lap_ms": 9_000, "total_ms": 27_000})
    assert Event.objects.get(kind="race.result").race == race.pk


def test_only_a_final_failure_writes_an_event(alice, now):
    race = a_race(now)
    failed = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(failed, UserFault("non_finite_action", step=7), now)
    assert Event.objects.get(kind="run.failed").data == {"reason": "non_finite_action"}
    stopped = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert stop_evaluation(evaluation=stopped.evaluation, now=now)
    assert not stop_evaluation(evaluation=stopped.evaluation, now=now)
    assert happened(kind="run.stopped") == [("run.stopped", "alice", stopped.evaluation.public_id)]
    given_up = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(given_up, PlatformFault("runner_died"), now)
    assert [row[2] for row in happened(kind="run.failed")] == [
        failed.evaluation.public_id,
        given_up.evaluation.public_id,
    ], "tried several times, given up once"


def test_entering_withdrawing_and_cancelling_write_events(alice, now):
    race = a_race(now)
    entry = enter_race(race=race, racer=alice, now=now)
    withdraw(entry=entry, now=now)
    enter_race(race=race, racer=alice, now=now)
    cancel_race(race=race, reason="Rain", now=now)
    assert happened(race=race.pk) == [
        ("race.board", None, race.slug),
        ("race.board", None, race.slug),
        ("race.cancelled", None, race.slug),
    ]
    assert Event.objects.get(kind="race.cancelled").data == {"reason": "Rain"}


def test_the_stages_of_duels_write_events(now):
    race = a_duel_race(now)
    qualify(race, [a_racer() for _ in range(3)], now)
    Event.objects.all().delete()
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    end_all(race, race.closes_at)
    kinds = [kind for kind, *_rest in happened(race=race.pk)]
    assert kinds[0] == "duels.drawn" and kinds[-1] == "duels.over"
    assert kinds.count("duel.decided") == race.duels.count() == 6
