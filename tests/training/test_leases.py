"""Who holds a training, and what becomes of it when its worker goes."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage

from core.jobs.models import Outage
from paddock.errors import PlatformFault, UserFault
from tests.training.jobs import a_training, an_iteration
from training.jobs.queue_order import place_of
from training.jobs.selectors import can_see_training, can_stop_training, minutes_used, visible_trainings
from training.jobs.services.queue import TRAININGS, stop_training
from training.jobs.services.records import (
    CHECKPOINTS_KEPT,
    SIMTRACES_KEPT,
    append_log,
    keep_checkpoint,
    networks_of,
    purge_trainings,
    record_iteration,
    record_prints,
)
from training.models import Checkpoint, JobState, TrainingIteration, TrainingJob
from training.rewards.examples import DEFAULT
from training.trainer.client import SavedState
from training.trainer.messages import Prints

NETWORKS = (b"best", b"last")
pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes")]


@pytest.fixture
def held(alice, oval, now) -> TrainingJob:
    a_training(alice, oval, now)
    job = TRAININGS.claim(worker="w", now=now)
    assert job is not None
    return job


def saved(iteration: int) -> SavedState:
    return SavedState(iteration, 100 * iteration, float(iteration), b"state")


def test_trainings_are_claimed_once_in_order_of_arrival(alice, bob, oval, now):
    second = a_training(bob, oval, now + timedelta(seconds=1))
    first = a_training(alice, oval, now)
    assert [place_of(job, now) for job in (first, second)] == [1, 2]
    assert TRAININGS.claim(worker="a", now=now) == first
    assert TRAININGS.claim(worker="b", now=now) == second
    assert TRAININGS.claim(worker="c", now=now) is None


def test_a_heartbeat_extends_the_lease_and_returns_a_stop(held, now):
    progress = {"steps": 5, "seconds": 2.0}
    assert TRAININGS.beat(pk=held.pk, lease=held.lease, progress=progress, now=now + timedelta(seconds=9))
    before = held.leased_until
    held.refresh_from_db()
    assert held.leased_until == before + timedelta(seconds=9)
    assert held.seconds_done == 2.0
    assert stop_training(job=held, now=now)
    assert held.state == JobState.RUNNING, "it ends with its models, in its worker's hands"
    heartbeat = TRAININGS.heartbeat(held)
    heartbeat.stop_asked = False
    assert heartbeat.look(None) and heartbeat.stop_asked


def test_a_storage_outage_counts_no_attempt(held, now):
    outage = Outage.objects.create(part="storage", since=now, look_at=now + timedelta(seconds=5))
    TrainingJob.objects.update(attempt=99)
    assert TRAININGS.fail(pk=held.pk, lease=held.lease, fault=PlatformFault("storage_failed"), now=now)
    held.refresh_from_db()
    assert (held.state, held.attempt, held.reason_code) == (JobState.QUEUED, 98, "")
    assert TRAININGS.claim(worker="w", now=now) is None
    outage.delete()
    assert TRAININGS.claim(worker="w", now=now) == held


def test_a_lost_lease_changes_nothing(held, now):
    other = uuid.uuid4()
    assert not TRAININGS.beat(pk=held.pk, lease=other, progress={"seconds": 99.0}, now=now)
    assert not record_iteration(job=held, lease=other, iteration=an_iteration(1), now=now)
    assert not keep_checkpoint(job=held, lease=other, saved=saved(1), networks=NETWORKS, now=now)
    assert not record_prints(job=held, lease=other, prints=Prints("late\n", "late\n", False), now=now)
    assert not TRAININGS.fail(pk=held.pk, lease=other, fault=UserFault("training_name_taken"), now=now)
    assert not TRAININGS.release(pk=held.pk, lease=other, now=now)
    held.refresh_from_db()
    assert (held.state, held.seconds_done, held.printed, held.log) == (JobState.RUNNING, 0.0, "", "")
    assert not TrainingIteration.objects.exists() and not Checkpoint.objects.exists()
    assert (
        not default_storage.exists(f"training/{held.public_id}")
        or not default_storage.listdir(f"training/{held.public_id}")[1]
    )


def test_an_expired_lease_is_requeued_for_as_long_as_it_takes(held, now, settings):
    """Hosts are killed, and that is nobody's fault who trains. It pauses ever longer, an hour at most."""
    settings.EVALUATION_MAX_ATTEMPTS = 2
    assert TRAININGS.sweep(now=held.leased_until).waiting == 0
    at, pauses = held.leased_until + timedelta(seconds=1), []
    for _ in range(9):
        TRAININGS.sweep(now=at)
        held.refresh_from_db()
        assert (held.state, held.reason_code, held.kills) == (JobState.QUEUED, "", 0)
        pauses.append((held.not_before - at).total_seconds() if held.not_before else 0)
        at = held.not_before or at
        assert TRAININGS.claim(worker="v", now=at - timedelta(seconds=1)) is None or not pauses[-1]
        held = TRAININGS.claim(worker="v", now=at) or TrainingJob.objects.get(pk=held.pk)
        at = held.leased_until + timedelta(seconds=1)
    assert pauses == [0, 4, 16, 64, 256, 1024, 3600, 3600, 3600]


def test_a_racers_fault_is_final(held, now):
    fault = UserFault("reward_raised", line=2, error="ZeroDivisionError")
    assert TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=now)
    held.refresh_from_db()
    assert (held.state, held.reason_params["line"]) == (JobState.FAILED, 2)
    assert "ZeroDivisionError" in held.reason


def test_a_worker_told_to_stop_hands_back_without_an_attempt(held, now):
    assert TRAININGS.release(pk=held.pk, lease=held.lease, now=now)
    held.refresh_from_db()
    assert (held.state, held.attempt) == (JobState.QUEUED, 0)


class TestRewardFunctionBreaksTrainer:
    """From inside of its process a function can bring about what looks like our fault. Not without end, not for
    nothing, and not in our name."""

    FAULT = PlatformFault("trainer_error", detail="TypeError: x")

    def test_repeated_breakdowns_become_the_racers_fault(self, held, now, settings):
        settings.EVALUATION_MAX_ATTEMPTS = 2
        minute = timedelta(minutes=1)
        assert TRAININGS.fail(pk=held.pk, lease=held.lease, fault=self.FAULT, now=now + minute)
        again = TRAININGS.claim(worker="w", now=now + minute)
        assert TRAININGS.fail(pk=again.pk, lease=again.lease, fault=self.FAULT, now=now + 2 * minute)
        held.refresh_from_db()
        assert (held.state, held.reason_code, held.attempt) == (JobState.FAILED, "training_broke_down", 2)
        assert "example" in held.reason and "%(" not in held.reason
        assert minutes_used(held.owner, now) == 2.0, "or it would train for nothing"
        assert TRAININGS.claim(worker="w", now=now + 2 * minute) is None

    def test_progress_starts_the_count_afresh(self, held, now, settings):
        """Attempts are counted by progress, not for life."""
        settings.EVALUATION_MAX_ATTEMPTS = 2
        job = held
        for number in range(1, 7):
            keep_checkpoint(job=job, lease=job.lease, saved=saved(number), networks=NETWORKS, now=now)
            TRAININGS.fail(pk=job.pk, lease=job.lease, fault=self.FAULT, now=now)
            job.refresh_from_db()
            assert (job.state, job.kills, job.failures, job.got_to) == (JobState.QUEUED, 1, 1, number)
            job = TRAININGS.claim(worker="w", now=now)
        TRAININGS.fail(pk=job.pk, lease=job.lease, fault=self.FAULT, now=now)
        job.refresh_from_db()
        assert (job.attempt, job.reason_code) == (7, "training_broke_down")
        assert job.reason_params["attempts"] == 2

    @pytest.mark.parametrize("others_pass", [True, False])
    def test_the_default_function_is_given_up_if_others_pass(self, alice, bob, oval, now, settings, others_pass):
        """While nobody's training passes the cause is ours, and nothing is given up."""
        settings.EVALUATION_MAX_ATTEMPTS = 1
        if others_pass:
            other = a_training(bob, oval, now)
            TrainingJob.objects.filter(pk=other.pk).update(
                state=JobState.FINISHED, ended_because="time", ended_at=now, steps_done=1
            )
        a_training(alice, oval, now, reward_code=DEFAULT.code)
        job = TRAININGS.claim(worker="w", now=now)
        TRAININGS.fail(pk=job.pk, lease=job.lease, fault=self.FAULT, now=now)
        job.refresh_from_db()
        assert (job.state, job.reason_code) == (
            (JobState.FAILED, "training_gave_up") if others_pass else (JobState.QUEUED, "")
        )

    @pytest.mark.parametrize(
        "fault",
        [
            PlatformFault("trainer_died", how="signal 9"),
            PlatformFault("storage_failed"),
            PlatformFault("internal_error"),
            PlatformFault("host_overloaded"),
            PlatformFault("sandbox_failed", detail="x"),
            PlatformFault("file_damaged"),
        ],
        ids=lambda fault: fault.code,
    )
    def test_an_outside_cause_is_not_blamed_on_it(self, held, now, settings, fault):
        settings.EVALUATION_MAX_ATTEMPTS = 1
        TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=now)
        held.refresh_from_db()
        assert (held.state, held.reason_code, held.kills, held.failures) == (JobState.QUEUED, "", 0, 1)


def test_platform_faults_are_logged_for_operators_only(held, now):
    fault = PlatformFault("trainer_error", detail="x")
    TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=now, detail="Traceback")
    held.refresh_from_db()
    assert held.state == JobState.QUEUED
    assert "Traceback" in held.operator_detail
    assert held.reason == ""


def test_old_checkpoints_go_with_their_files(held, now):
    for number in range(1, 6):
        assert keep_checkpoint(job=held, lease=held.lease, saved=saved(number), networks=NETWORKS, now=now)
    assert [one.iteration for one in Checkpoint.objects.all()] == [5, 4]
    assert len(default_storage.listdir(f"training/{held.public_id}")[1]) == 2 * CHECKPOINTS_KEPT
    assert networks_of(Checkpoint.objects.first()) == NETWORKS
    fault = UserFault("reward_raised", line=2, error="KeyError")
    TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=now)
    held.refresh_from_db()
    assert (held.state, held.reason_code) == (JobState.QUEUED, "reward_raised"), "a worker makes models of them first"
    again = TRAININGS.claim(worker="v", now=now)
    TRAININGS.fail(pk=again.pk, lease=again.lease, fault=UserFault("onnx_corrupt"), now=now)
    held.refresh_from_db()
    assert (held.state, held.reason_code) == (JobState.FAILED, "reward_raised"), "they are no networks"
    assert not Checkpoint.objects.exists()


def test_a_resumed_training_overwrites_later_iterations(held, now):
    for number in (1, 2, 3):
        record_iteration(job=held, lease=held.lease, iteration=an_iteration(number, eval_reward=1.0), now=now)
    record_iteration(job=held, lease=held.lease, iteration=an_iteration(2, eval_reward=7.0), now=now)
    assert list(held.iterations.values_list("number", "eval_reward")) == [(1, 1.0), (2, 7.0)]
    assert len(default_storage.listdir(f"training/{held.public_id}")[1]) == 2


def test_only_one_iteration_is_the_best(held, now):
    record_iteration(job=held, lease=held.lease, iteration=an_iteration(1), now=now)
    record_iteration(job=held, lease=held.lease, iteration=an_iteration(2), now=now)
    record_iteration(job=held, lease=held.lease, iteration=an_iteration(3, is_best=False), now=now)
    assert list(held.iterations.values_list("is_best", flat=True)) == [False, True, False]


def printing(held, now, kept, last="", more=False) -> str:
    assert record_prints(job=held, lease=held.lease, prints=Prints(kept, last, more), now=now)
    held.refresh_from_db()
    return held.log


def test_prints_go_to_the_log_and_the_newest_beside_it(held, now):
    log = printing(held, now, "one\n\n<b>two</b>\n", "<b>two</b>\n")
    assert log == "".join(f"{now:%Y-%m-%d %H:%M:%S} print: {line}\n" for line in ("one", "", "<b>two</b>"))
    assert held.printed == "<b>two</b>\n"
    assert printing(held, now, "", "three\n") == log and held.printed == "three\n"


def test_the_log_keeps_the_first_prints_across_workers(held, now):
    append_log(job_id=held.pk, line="training starts on w", now=now)
    for _ in range(3):  # each trainer's process begins anew
        log = printing(held, now, "x" * 9_999 + "\n", more=True)
    kept = [line[27:] for line in log.splitlines() if " print: " in line]
    assert [len(line) for line in kept[:1]] == [9_999] and "and no more" in kept[1]
    assert len(kept) == 2, "nothing comes after that"


def test_the_log_is_cut_at_its_limit(held, now):
    for _ in range(3):
        log = printing(held, now, "x" * 9_999 + "\n")
    kept = [line[27:] for line in log.splitlines()]
    assert [len(line) for line in kept[:2]] == [9_999, 6_000] and "and no more" in kept[2]
    assert len(kept) == 3


def test_older_sim_traces_are_removed_as_new_ones_come(held, now, monkeypatch):
    monkeypatch.setattr("training.jobs.services.records.SIMTRACES_KEPT", 2)
    assert SIMTRACES_KEPT > 10
    for number in range(1, 5):
        record_iteration(job=held, lease=held.lease, iteration=an_iteration(number), now=now)
    assert [bool(one.simtrace) for one in held.iterations.all()] == [False, False, True, True]
    assert len(default_storage.listdir(f"training/{held.public_id}")[1]) == 2


def test_sim_traces_of_old_trainings_are_removed(held, now):
    """And what a killed worker left beside them. The rest of the training stays."""
    folder = f"training/{held.public_id}"
    record_iteration(job=held, lease=held.lease, iteration=an_iteration(1), now=now)
    default_storage.save(f"{folder}/left.checkpoint", ContentFile(b"of a killed worker"))
    zipped = default_storage.save(f"{folder}/sb3.zip", ContentFile(b"zip"))
    assert purge_trainings(now=now + timedelta(days=365)) == 0, "it runs still"
    TrainingJob.objects.filter(pk=held.pk).update(
        state=JobState.STOPPED,
        ended_because="stopped",
        lease=None,
        leased_until=None,
        ended_at=now,
        sb3_zip=zipped,
    )
    assert purge_trainings(now=now + timedelta(days=30)) == 0
    assert purge_trainings(now=now + timedelta(days=30) + timedelta(seconds=1)) == 1
    assert default_storage.listdir(folder)[1] == ["sb3.zip"]
    assert held.iterations.get().eval_progress == 5.0
    assert purge_trainings(now=now + timedelta(days=365)) == 0


def test_a_worker_stops_a_waiting_training_with_a_checkpoint(held, now):
    keep_checkpoint(job=held, lease=held.lease, saved=saved(1), networks=NETWORKS, now=now)
    TRAININGS.release(pk=held.pk, lease=held.lease, now=now)
    assert stop_training(job=held, now=now)
    assert (held.state, held.stop_asked_at) == (JobState.QUEUED, now)


def test_its_owner_and_admins_may_see_and_stop_it(held, alice, bob, charlie):
    charlie.is_staff = True
    for racer, allowed in ((alice, True), (bob, False), (charlie, True)):
        assert can_see_training(racer, held) is allowed
        assert can_stop_training(racer, held) is allowed
        assert (held in visible_trainings(racer)) is allowed
    held.state = JobState.STOPPED
    assert not can_stop_training(alice, held)
