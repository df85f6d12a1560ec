"""A sweep from its creation to the model of its best trial, with a trainer that is made up."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, OperationalError, transaction

from accounts.quotas import used_by
from core.events import Event
from evaluation.models import TrainedModel
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.rules.training import taken_from
from tests.training.jobs import REWARD, a_training, an_iteration, network
from training import tasks
from training.jobs.selectors import can_delete_training, minutes_used, trainings_of
from training.jobs.services import worker as work
from training.jobs.services.deletion import delete_training
from training.jobs.services.queue import repeatable, stop_training
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS
from training.models import Checkpoint, JobState, Sweep, SweepState, SweepTrial, TrainingIteration, TrainingJob
from training.quotas import AT_ONCE
from training.sweeps import services
from training.sweeps.selectors import (
    can_delete_sweep,
    can_see_sweep,
    can_stop_sweep,
    importances,
    rows_of,
    sweeps_of,
    visible_sweeps,
)
from training.sweeps.services import advance_sweeps, create_sweep, delete_sweep, stop_sweep, sweeps_due
from training.trainer.client import Ended, SavedState

pytest.importorskip("optuna", reason="training is not installed: make training")
pytestmark = [
    pytest.mark.django_db(transaction=True),
    pytest.mark.usefixtures("training_wakes", "wakes", "admitted_here"),
]
LR = {"lr": {"low": 1e-5, "high": 1e-3}}


def a_sweep(owner, track, now, *, count: int = 3, budget_s: int = 60, search=None, **changes) -> Sweep:
    asked = {
        "name": "tune",
        "reward_code": REWARD,
        "action_space_type": "discrete",
        "action_space": [dict(action) for action in DEFAULT_ACTIONS],
        "seed": 5,
    }
    settings, rest = taken_from(asked | changes)
    search = {"hyperparameters": LR} if search is None else search
    return create_sweep(
        owner=owner, track=track, settings=settings, count=count, budget_s=budget_s, search=search, now=now, **rest
    )


class FakeTrainer:
    """A trial's first evaluation has the progress that ``scores`` has for its number, each later one ten more."""

    def __init__(self) -> None:
        self.scores = {1: 30.0, 2: 80.0, 3: 50.0}
        self.runs: list[tuple[int, str, float]] = []  # trial, start, seconds at its end
        self.faults: dict[int, PaddockError] = {}
        self.meanwhile = lambda job: None

    def __call__(self, spec, listener, *, start, blob, asked_to_stop, abandoned):
        job = listener._job
        number = job.trial.number
        self.runs.append((number, start, spec.stop_seconds))
        listener.ready()
        at = spec.iterations_before + 1
        values = {"eval_progress": min(100.0, self.scores[number] + 10.0 * (at - 1))}
        values["eval_lap_ms"] = 9000 if values["eval_progress"] == 100.0 else None
        made = an_iteration(at, seconds=spec.stop_seconds, **values)
        listener.iteration(type(made)(made.values, made.driving, network(job, 10 * number + at), b""))
        if number in self.faults:
            raise self.faults[number]
        if spec.continues:
            listener.checkpoint(SavedState(at, 100 * at, spec.stop_seconds, b"state"))
        self.meanwhile(job)
        if abandoned():
            raise UserFault("stopped")
        job.refresh_from_db()
        return Ended("stopped" if job.stop_asked_at else "time", 100 * at, spec.stop_seconds, b"zip")


@pytest.fixture
def trainer(monkeypatch) -> FakeTrainer:
    made = FakeTrainer()
    monkeypatch.setattr(work, "train", made)
    return made


def work_off(most: int = 40) -> None:
    """Turns of a trainer until nothing is left."""
    for _ in range(most):
        if not tasks.train.apply().get():
            return
    raise AssertionError("it does not end")


def test_the_best_setting_becomes_a_model(alice, oval, now, trainer):
    sweep = a_sweep(alice, oval, now)
    work_off()
    sweep.refresh_from_db()
    assert (sweep.state, sweep.best.number) == (SweepState.FINISHED, 2)
    assert trainer.runs == [(1, "", 10.0), (2, "", 10.0), (3, "", 10.0), (2, "checkpoint", 40.0)]
    job = sweep.best.job
    assert (job.state, job.best_model.name, job.best_model.owner) == (JobState.FINISHED, "tune-2", alice)
    assert TrainedModel.objects.count() == 1, "best and last are one network here, and no other trial has a model"
    assert [len(trial.results) for trial in sweep.trials.all()] == [1, 2, 1]
    assert sweep.trials.get(number=2).results[1] == {"seconds": 40.0, "progress": 90.0, "lap_ms": None}
    assert not Checkpoint.objects.exists()
    assert [event.subject for event in Event.objects.filter(kind="training.ended")] == [job.public_id]
    assert [row.state for row in rows_of(sweep)] == ["pruned", "best", "pruned"]


def test_trials_share_everything_but_their_setting(alice, oval, now, trainer):
    search = {
        "hyperparameters": {"batch_size": {"choices": [32, 64, 128]}},
        "action_spaces": [{"action_space_type": "continuous", "action_space": DEFAULT_BOUNDS}],
        "reward_functions": [REWARD + "\n# another\n"],
    }
    trainer.scores = dict.fromkeys(range(1, 13), 10.0)
    sweep = a_sweep(alice, oval, now, count=12, budget_s=600, search=search, trials=2, alternate_direction=True)
    work_off()
    sweep.refresh_from_db()
    trials = list(sweep.trials.select_related("job"))
    first = trials[0].setting
    assert first == {"hyperparameters": {"batch_size": 64}, "action_space": 0, "reward_function": 0}
    assert len({str(trial.setting) for trial in trials}) == 12, "twelve settings that differ"
    for trial in trials:
        job, setting = trial.job, trial.setting
        assert (job.trials, job.alternate_direction, job.seed, job.track) == (2, True, 5, oval)
        assert (job.stop_steps, job.stop_clean_laps) == (None, None)
        assert job.hyperparameters == trials[0].job.hyperparameters | setting["hyperparameters"]
        assert job.action_space_type == ("discrete", "continuous")[setting["action_space"]]
        assert job.reward_code == sweep.space["reward_functions"][setting["reward_function"]]
    assert sweep.state == SweepState.FINISHED
    assert sum(trial.results[-1]["seconds"] for trial in trials) == pytest.approx(600.0)


def test_a_killed_worker_loses_nothing(alice, oval, now, trainer):
    """After each turn another process goes on from the rows alone; one turn is handed back in its midst."""
    a_sweep(alice, oval, now)
    for _ in range(2):
        advance_sweeps(now=now)
        assert work.run_next_training(worker="w")
    advance_sweeps(now=now)
    assert work.run_next_training(worker="w", interrupted=lambda: True)
    assert TrainingJob.objects.get(state=JobState.QUEUED).trial.number == 3
    work_off()
    sweep = Sweep.objects.get()
    assert (sweep.state, sweep.best.number) == (SweepState.FINISHED, 2)
    assert [len(trial.results) for trial in sweep.trials.all()] == [1, 2, 1]


def test_a_sweep_has_one_training_under_way(alice, oval, now, trainer, monkeypatch):
    """Two workers decide at once: the slower one changes nothing."""
    sweep = a_sweep(alice, oval, now)
    assert work.run_next_training(worker="w")
    decide = services.rows_of
    calls = []

    def slow(one):
        rows = decide(one)
        calls.append(one)
        if len(calls) == 1:  # the first has read; another worker advances
            monkeypatch.setattr(services, "rows_of", decide)
            assert advance_sweeps(now=now) == 1
        return rows

    monkeypatch.setattr(services, "rows_of", slow)
    assert not services.advance_sweep(sweep=sweep, now=now)
    assert [trial.job.state for trial in sweep.trials.select_related("job")] == ["finished", "queued"]


def test_a_sweep_that_cannot_advance_stops_no_other(alice, bob, oval, now, trainer, monkeypatch):
    first, second = a_sweep(alice, oval, now), a_sweep(bob, oval, now)
    work.run_next_training(worker="w")
    work.run_next_training(worker="w")
    decide = services.rows_of

    def broken(sweep):
        if sweep == first:
            raise ValueError("broken")
        return decide(sweep)

    monkeypatch.setattr(services, "rows_of", broken)
    assert advance_sweeps(now=now) == 1
    assert (first.trials.count(), second.trials.count()) == (1, 2)
    first.refresh_from_db()
    assert (first.state, first.reason_code) == (SweepState.FAILED, "sweep_broke_down")
    assert "could not choose the next setting" in first.reason
    assert not sweeps_due().exists(), "it is not tried again"


def test_an_outage_of_the_database_ends_no_sweep(alice, oval, now, trainer, monkeypatch):
    sweep = a_sweep(alice, oval, now)
    work.run_next_training(worker="w")

    def out(_):
        raise OperationalError("out")

    monkeypatch.setattr(services, "rows_of", out)
    with pytest.raises(OperationalError):
        advance_sweeps(now=now)
    sweep.refresh_from_db()
    assert sweep.state == SweepState.RUNNING


class TestFailures:
    def test_a_failed_trial_is_left_out(self, alice, oval, now, trainer):
        trainer.faults[2] = UserFault("training_diverged")
        sweep = a_sweep(alice, oval, now)
        work_off()
        sweep.refresh_from_db()
        assert (sweep.state, sweep.best.number) == (SweepState.FINISHED, 3)
        failed = sweep.trials.get(number=2).job
        assert (failed.state, failed.reason_code) == (JobState.FAILED, "training_diverged")
        assert not repeatable(TrainingJob.objects.filter(pk=failed.pk)).exists()

    def test_where_the_last_trial_fails_the_next_best_becomes_the_model(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        trainer.meanwhile = lambda job: (
            trainer.runs[-1][:2] == (2, "checkpoint") and (_ for _ in ()).throw(UserFault("training_diverged"))
        )
        work_off()
        sweep.refresh_from_db()
        assert sweep.state == SweepState.FINISHED
        assert sweep.best.job.best_model is not None
        assert sweep.best.number == 2, "what it had learned before is kept, as of every training"

    def test_where_all_fail_the_sweep_fails_with_their_reason(self, alice, oval, now, trainer):
        trainer.faults = dict.fromkeys((1, 2, 3), UserFault("reward_raised", line=4, error="KeyError"))
        trainer.scores = dict.fromkeys((1, 2, 3), 0.0)
        sweep = a_sweep(alice, oval, now)
        work_off()
        sweep.refresh_from_db()
        assert (sweep.state, sweep.reason_code) == (SweepState.FAILED, "reward_raised")
        assert "KeyError" in sweep.reason
        assert not Checkpoint.objects.exists()

    def test_our_fault_repeats_the_trial(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        trainer.faults[1] = PlatformFault("trainer_died", how="signal 9")
        advance_sweeps(now=now)
        work.run_next_training(worker="w")
        assert sweep.trials.get().job.state == JobState.QUEUED
        trainer.faults.clear()
        work_off()
        sweep.refresh_from_db()
        assert sweep.state == SweepState.FINISHED


class TestStop:
    def test_before_it_begins(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        assert stop_sweep(sweep=sweep, now=now, by=alice)
        assert (sweep.state, sweep.best) == (SweepState.STOPPED, None)
        assert sweep.trials.get().job.state == JobState.STOPPED
        assert not stop_sweep(sweep=sweep, now=now, by=alice)
        work_off()
        assert trainer.runs == []

    def test_the_best_so_far_becomes_a_model(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        trainer.meanwhile = lambda job: job.trial.number == 3 and stop_sweep(sweep=sweep, now=now, by=alice)
        work_off()
        sweep.refresh_from_db()
        assert (sweep.state, sweep.best.number) == (SweepState.STOPPED, 2)
        assert sweep.best.job.best_model.name == "tune-2"
        assert trainer.runs[-1][:2] == (2, "checkpoint")
        assert not Checkpoint.objects.exists()

    def test_between_two_trials(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        work.run_next_training(worker="w")
        assert stop_sweep(sweep=sweep, now=now, by=alice)
        assert sweep.state == SweepState.RUNNING, "its model is to be made yet"
        work_off()
        sweep.refresh_from_db()
        assert (sweep.state, sweep.best.number) == (SweepState.STOPPED, 1)

    def test_one_trial_stopped_by_itself_is_left_out(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        trainer.meanwhile = lambda job: trainer.runs[-1] == (2, "", 10.0) and stop_training(job=job, now=now, by=alice)
        work_off()
        sweep.refresh_from_db()
        assert sweep.state == SweepState.FINISHED
        assert (2, "checkpoint", 40.0) not in trainer.runs


class TestRefusals:
    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            ({"name": "with blank"}, "sweep_name_form"),
            ({"name": "x" * 59}, "sweep_name_form"),
            ({"count": 1}, "sweep_settings"),
            ({"budget_s": 5}, "sweep_budget"),
            ({"search": {}}, "sweep_space_empty"),
            ({"search": {"hyperparameters": {"lr": {"low": 1, "high": 2}}}}, "training_hyperparameter"),
            ({"algorithm": "dqn"}, "training_algorithm"),
            ({"trials": 11}, "training_trials"),
            ({"reward_code": " "}, "training_reward_missing"),
            ({"budget_s": 86_400}, "training_minutes_left"),
        ],
    )
    def test_nothing_begins(self, alice, oval, now, changes, code, settings):
        settings.TRAINING_MINUTES_A_MONTH = 60
        with pytest.raises(UserFault) as refused:
            a_sweep(alice, oval, now, **changes)
        assert refused.value.code == code
        assert not Sweep.objects.exists() and not TrainingJob.objects.exists()

    def test_a_running_sweeps_name_is_taken(self, alice, bob, oval, now):
        a_sweep(alice, oval, now)
        with pytest.raises(UserFault) as refused:
            a_sweep(alice, oval, now)
        assert refused.value.code == "sweep_name_taken"
        assert a_sweep(bob, oval, now).name == "tune"

    def test_an_action_space_that_the_cloned_model_lacks(self, alice, oval, now):
        from tests.rows import model_row

        model = model_row(alice, name="mine")
        search = {"action_spaces": [{"action_space_type": "continuous", "action_space": DEFAULT_BOUNDS}]}
        with pytest.raises(UserFault) as refused:
            a_sweep(alice, oval, now, count=2, search=search, clone_from=model)
        assert refused.value.code.startswith("clone_")

    def test_without_optuna(self, alice, oval, now, monkeypatch):
        monkeypatch.setattr(services, "find_spec", lambda name: None)
        with pytest.raises(PlatformFault) as refused:
            a_sweep(alice, oval, now)
        assert refused.value.code == "training_unavailable"

    def test_a_trials_training_is_deleted_with_its_sweep_alone(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now)
        with pytest.raises(UserFault) as refused:
            delete_sweep(sweep=sweep, now=now)
        assert refused.value.code == "sweep_running"
        work_off()
        job = sweep.trials.get(number=1).job
        assert not can_delete_training(alice, job)
        with pytest.raises(UserFault) as refused:
            delete_training(job=job, now=now)
        assert refused.value.code == "training_of_sweep"
        used = minutes_used(alice, now)
        delete_sweep(sweep=sweep, now=now)
        assert not Sweep.objects.exists() and not SweepTrial.objects.exists() and not TrainingIteration.objects.exists()
        assert TrainingJob.objects.filter(deleted_at=None).count() == 0
        assert TrainedModel.objects.filter(deleted_at=None).count() == 1, "the model stays"
        assert minutes_used(alice, now) == used


class TestQuotas:
    def test_a_sweep_counts_its_budget_until_it_ends(self, alice, oval, now, trainer):
        sweep = a_sweep(alice, oval, now, budget_s=600)
        assert (minutes_used(alice, now), used_by(alice, AT_ONCE.name, now)) == (10.0, 1)
        work.run_next_training(worker="w")
        TrainingJob.objects.update(charged_s=60.0)
        assert (minutes_used(alice, now), used_by(alice, AT_ONCE.name, now)) == (10.0, 1)
        work_off()
        TrainingJob.objects.update(charged_s=60.0)
        assert (minutes_used(alice, now), used_by(alice, AT_ONCE.name, now)) == (3.0, 0)
        assert sweeps_of(alice).get() == sweep

    def test_it_is_one_of_the_trainings_at_once(self, alice, oval, now, settings):
        settings.TRAININGS_AT_ONCE = 1
        a_sweep(alice, oval, now)
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now)
        assert refused.value.code == "training_jobs_at_once"

    def test_its_trials_are_not_listed_among_the_trainings(self, alice, oval, now):
        a_sweep(alice, oval, now)
        job = a_training(alice, oval, now)
        assert list(trainings_of(alice)) == [job]


class TestWhoSees:
    @pytest.mark.parametrize(("name", "sees", "stops"), [("alice", True, True), ("bob", False, False)])
    def test_racers(self, request, alice, oval, now, name, sees, stops):
        sweep, racer = a_sweep(alice, oval, now), request.getfixturevalue(name)
        self.check(sweep, racer, sees, stops)

    def test_an_admin(self, alice, bob, oval, now):
        bob.is_staff = True
        sweep = a_sweep(alice, oval, now)
        self.check(sweep, bob, True, True)
        assert not can_delete_sweep(bob, sweep)

    def test_a_guest(self, alice, oval, now):
        from django.contrib.auth.models import AnonymousUser

        self.check(a_sweep(alice, oval, now), AnonymousUser(), False, False)

    def check(self, sweep, racer, sees, stops):
        assert can_see_sweep(racer, sweep) is sees
        assert visible_sweeps(racer).filter(pk=sweep.pk).exists() is sees
        assert can_stop_sweep(racer, sweep) is stops
        assert not can_delete_sweep(racer, sweep), "it runs"


class TestImportance:
    def test_what_decides_comes_first(self, alice, oval, now, trainer):
        search = {"hyperparameters": LR, "reward_functions": [REWARD + "\n# b\n"]}
        sweep = a_sweep(alice, oval, now, count=9, budget_s=600, search=search)
        trainer.scores = dict.fromkeys(range(1, 10), 10.0)
        work_off()
        for trial in sweep.trials.all():
            trial.results[0]["progress"] = 20.0 + 40.0 * trial.setting["reward_function"]
            trial.save()
        found = importances(sweep, rows_of(sweep))
        assert [one.name for one in found] == ["reward_function", "lr"]
        assert found[0].share == pytest.approx(1.0) and found[1].share < 0.9

    def test_too_few_trials_show_nothing(self, alice, oval, now):
        sweep = a_sweep(alice, oval, now)
        assert importances(sweep, rows_of(sweep)) == []


def test_queries_do_not_grow_with_trials(alice, oval, now, trainer, django_assert_num_queries):
    trainer.scores = dict.fromkeys(range(1, 10), 10.0)
    sweep = a_sweep(alice, oval, now, count=9, budget_s=600)
    work_off()
    with django_assert_num_queries(2):
        assert len([(row.state, row.rung, row.score) for row in rows_of(sweep)]) == 9


def test_the_periodic_task_wakes_a_trainer_for_a_sweep(alice, oval, now, trainer, training_wakes):
    a_sweep(alice, oval, now)
    work.run_next_training(worker="w")
    training_wakes.clear()
    assert sweeps_due().count() == 1
    tasks.sweep.apply()
    assert len(training_wakes) == 1


@pytest.mark.parametrize(
    "columns",
    [
        {"settings_count": 1},
        {"settings_count": 13},
        {"budget_s": 0},
        {"state": "paused"},
        {"state": "failed"},
        {"state": "finished", "ended_at": None},
    ],
)
def test_the_database_refuses_impossible_sweeps(alice, oval, now, columns):
    sweep = a_sweep(alice, oval, now)
    ended = {"ended_at": now + timedelta(1)} if columns.get("state") == "failed" else {}
    with pytest.raises(IntegrityError), transaction.atomic():
        Sweep.objects.filter(pk=sweep.pk).update(**columns | ended)
