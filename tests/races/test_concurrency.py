"""Two tabs, two workers, an organiser and a racer at the same moment: on SQLite here, on PostgreSQL below."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import timedelta
from threading import Barrier, Thread

import pytest
from django.db import connection

from accounts.models import RacerQuota
from evaluation.models import Evaluation, TrainedModel
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import PaddockError
from races.entries.services.entries import enter_race, withdraw
from races.entries.services.standings import recompute_race
from races.entries.services.submissions import submit_model
from races.models import Entry, OwnEvaluation, Race, RaceCar, Submission
from races.pages.services import cancel_race, create_community_race, edit_race
from races.test_runs.services import delete_own, drive_own
from tests.factories import a_model, a_race, a_racer, a_track, laps, outcome, start

pytestmark = pytest.mark.django_db(transaction=True)
ABOUT_THE_DATABASE = (  # locks, constraints, triggers, plans and queries
    "boards",
    "concurrency",
    "counting",
    "duels_concurrency",
    "duels_kept",
    "entries",
    "own",
    "races",
    "redrives_concurrency",
    "standings",
    "submit",
    "visibility",
)
DUELS = (  # what follows from their results is worked out in Python: one race of each format shows that it is read back
    "test_duels.py::test_the_constant_winner_leads_a_finished_round_robin[3-4-6]",
    "test_duels.py::test_the_winner_of_the_final_leads_a_finished_bracket[4]",
    "test_duels.py::test_equal_points_are_ranked_by_average_lap_then_seed",
)


def at_once(calls: Sequence[Callable[[], object]]) -> list[object]:
    """Run the calls in threads that begin together; what each returned or raised, refusals as their code."""
    answers: list[object] = [None] * len(calls)
    gate = Barrier(len(calls))

    def run(index: int) -> None:
        gate.wait(timeout=30)
        try:
            answers[index] = calls[index]()
        except PaddockError as fault:
            answers[index] = fault.code
        except BaseException as error:
            answers[index] = error
        finally:
            connection.close()

    threads = [Thread(target=run, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive(), "a thread hangs"
    return answers


def test_of_six_cars_sent_at_once_one_is_queued(now):
    race, racer = a_race(now), a_racer()
    models = [a_model(racer) for _ in range(6)]
    answers = at_once([lambda m=m: submit_model(race=race, racer=racer, model=m, now=now) for m in models])
    assert sorted(str(a) for a in answers if not isinstance(a, Submission)) == ["submission_running"] * 5, answers
    entry = Entry.objects.get()
    assert (entry.submission_count, entry.last_number, Evaluation.objects.count()) == (1, 1, 1)


def test_of_six_own_runs_asked_for_at_once_no_more_are_queued_than_may_be(now):
    racer, track = a_racer(), a_track()
    RacerQuota.objects.create(racer=racer, name="own_runs_at_once", limit=2)
    models = [a_model(racer) for _ in range(6)]
    answers = at_once([lambda m=m: drive_own(owner=racer, model=m, track=track, now=now) for m in models])
    assert [a for a in answers if not isinstance(a, OwnEvaluation)] == ["own_runs_at_once"] * 4, answers
    assert Evaluation.objects.count() == OwnEvaluation.objects.count() == 2


def test_own_runs_that_end_at_once_submit_one_car_at_a_time(now):
    race, racer = a_race(now), a_racer()
    asked = [drive_own(owner=racer, model=a_model(racer), race=race, submit_if_better=True, now=now) for _ in range(4)]
    runs = [start(own.evaluation, now) for own in asked]

    def end(run):
        return finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome(laps(9, 9, 9)), now=now)

    answers = at_once([lambda run=run: end(run) for run in runs])
    assert answers == [True] * 4
    submitted = OwnEvaluation.objects.values_list("submission", "submit_reason_code")
    assert sorted(reason for _, reason in submitted) == ["", *["submission_running"] * 3]
    assert Submission.objects.count() == 1 == Entry.objects.get().submission_count


def test_an_own_run_that_is_deleted_twice_at_once_is_gone(now):
    racer = a_racer()
    own = drive_own(owner=racer, model=a_model(racer), track=a_track(), now=now)
    stop_evaluation(evaluation=own.evaluation, now=now)
    assert at_once([lambda: delete_own(own=own, now=now)] * 3) == [None] * 3
    assert not Evaluation.objects.exists() and OwnEvaluation.objects.get().deleted_at == now


def test_the_last_submission_is_used_only_once(now):
    race, racer = a_race(now, max_submissions=1), a_racer()
    models = [a_model(racer) for _ in range(4)]

    def send_and_finish(model):
        submission = submit_model(race=race, racer=racer, model=model, now=now)
        running = start(submission.evaluation, now)
        finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(laps(9, 9, 9)), now=now)
        return "sent"

    answers = at_once([lambda m=m: send_and_finish(m) for m in models])
    assert answers.count("sent") == 1, answers
    assert set(answers) <= {"sent", "submission_running", "submissions_used_up"}, answers
    assert Entry.objects.get().submission_count == 1


def test_one_car_sent_twice_at_once_is_one_submission(now):
    race, racer = a_race(now), a_racer()
    model = a_model(racer)
    answers = at_once([lambda: submit_model(race=race, racer=racer, model=model, now=now)] * 4)
    assert sorted(str(a) for a in answers if not isinstance(a, Submission)) == ["car_already_submitted"] * 3, answers


def test_rules_changed_during_a_submission_apply_or_are_refused(now):
    organiser = a_racer()
    for round_number in range(5):
        race, racer = a_race(now, organiser=organiser), a_racer()
        model = a_model(racer)
        sent, changed = at_once(
            [
                lambda race=race, racer=racer, model=model: submit_model(race=race, racer=racer, model=model, now=now),
                lambda race=race: edit_race(race=Race.objects.get(pk=race.pk), now=now, laps=7),
            ]
        )
        assert isinstance(sent, Submission), (round_number, sent)
        driven = Evaluation.objects.get(pk=sent.evaluation_id).spec["rules"]["laps"]
        assert driven == Race.objects.get(pk=race.pk).laps, (round_number, changed)
        assert (driven == 7) == isinstance(changed, Race), (round_number, changed)


def test_concurrent_requests_cannot_exceed_the_race_limit(now, settings):
    settings.RACES_PER_RACER = 2
    racer, track = a_racer(), a_track()
    times = {"opens_at": now, "closes_at": now + timedelta(days=1)}
    answers = at_once(
        [lambda: create_community_race(organiser=racer, now=now, name="Sprint", track=track, **times)] * 6
    )
    assert answers.count("race_limit") == 4, answers
    assert Race.objects.count() == 2


def test_concurrent_results_stops_and_withdrawals_lose_nothing(now):
    """Every lock order that the services have, in one race at one moment."""
    race, fast, slow = a_race(now), a_racer(), a_racer()
    keep = [a_racer() for _ in range(3)]
    runs = {}
    for racer in (fast, slow, *keep):
        submission = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
        runs[racer.pk] = start(submission.evaluation, now)

    def end(racer, time_ms):
        running = runs[racer.pk]
        driven = outcome(laps(time_ms, time_ms, time_ms))
        return finish_evaluation(pk=running.pk, lease=running.lease, outcome=driven, now=now)

    def leave_and_return(racer):
        withdraw(entry=Entry.objects.get(race=race, racer=racer), now=now)
        return enter_race(race=race, racer=racer, now=now)

    answers = at_once(
        [
            lambda: end(fast, 8_000),
            lambda: leave_and_return(fast),
            lambda: end(slow, 9_900),
            lambda: stop_evaluation(evaluation=Evaluation.objects.get(pk=runs[slow.pk].pk), now=now),
            lambda: edit_race(race=Race.objects.get(pk=race.pk), now=now, description="Hello"),
            *(lambda racer=racer, n=n: end(racer, 9_000 + n) for n, racer in enumerate(keep)),
        ]
    )
    assert not [answer for answer in answers if isinstance(answer, BaseException)], answers
    before = list(Entry.objects.order_by("pk").values()), Race.objects.values().get()
    recompute_race(race=Race.objects.get())
    assert (list(Entry.objects.order_by("pk").values()), Race.objects.values().get()) == before
    assert Entry.objects.filter(racer__in=keep, classified=True).count() == 3


def test_cancelling_while_results_arrive_cancels_the_race(now):
    race = a_race(now)
    runs = []
    for _ in range(4):
        racer = a_racer()
        submission = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
        runs.append(start(submission.evaluation, now))

    def end(running):
        driven = outcome(laps(9_000, 9_000, 9_000))
        return finish_evaluation(pk=running.pk, lease=running.lease, outcome=driven, now=now)

    answers = at_once(
        [
            lambda: cancel_race(race=race, reason="Rain.", now=now),
            *(lambda running=running: end(running) for running in runs),
        ]
    )
    assert isinstance(answers[0], Race), answers
    assert set(answers[1:]) <= {True, False}, answers
    assert not Evaluation.objects.filter(ended_at=None).exists(), "nothing drives in a cancelled race"


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_postgresql_gives_the_same_guarantees(again_on_postgresql):
    files = (f"test_{name}.py" for name in ABOUT_THE_DATABASE)
    # the storm, too
    videos = ("tests/videos/test_concurrency.py", "tests/videos/test_queue.py", "tests/videos/test_storm.py")
    again_on_postgresql(
        *(f"tests/races/{name}" for name in (*files, *DUELS)), *videos, "-m", "not postgres"
    )  # the storm, too


def test_of_two_racers_sending_one_car_at_once_one_is_accepted(now):
    for _ in range(3):
        race, sample = a_race(now), a_model(a_racer(is_house=True))
        models = [a_model(a_racer()) for _ in range(4)]
        TrainedModel.objects.filter(pk__in=[model.pk for model in models]).update(network=sample.network)
        models = [TrainedModel.objects.select_related("network").get(pk=model.pk) for model in models]
        answers = at_once(
            [lambda m=m, race=race: submit_model(race=race, racer=m.owner, model=m, now=now) for m in models]
        )
        assert sorted(str(a) for a in answers if not isinstance(a, Submission)) == ["car_of_another"] * 3, answers
        assert RaceCar.objects.get(race=race).entry == Submission.objects.get(entry__race=race).entry
