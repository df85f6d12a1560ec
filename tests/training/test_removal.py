"""Deleting a training: what goes, what stays, and who may."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.files.storage import default_storage
from django.db import IntegrityError, transaction
from django.urls import reverse
from django.utils import timezone

from accounts.quotas import limit_of, used_by
from accounts.usage.storage import MEGABYTE, stored_by
from evaluation.models import State, TrainedModel
from evaluation.running.queue.services import queue_evaluation
from evaluation.stored_files import store
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from races.entries.services.submissions import submit_model
from tests.factories import a_race
from tests.training.jobs import a_training, an_iteration
from tests.training.test_leases import NETWORKS, saved
from training.jobs.selectors import (
    can_delete_training,
    can_see_training,
    minutes_used,
    trainings_of,
    visible_trainings,
)
from training.jobs.services.deletion import delete_training, forget_deleted
from training.jobs.services.queue import TRAININGS
from training.jobs.services.records import keep_checkpoint, record_iteration
from training.models import JobState, TrainingJob
from training.quotas import bytes_of, files_of

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes", "wakes")]


@pytest.fixture
def over(alice, oval, now) -> TrainingJob:
    """A training of ten minutes that is over, with a sim-trace and the model for stable-baselines3: 2 MB and a bit."""
    from tests.factories import a_model

    a_training(alice, oval, now)
    job = TRAININGS.claim(worker="w", now=now)
    record_iteration(job=job, lease=job.lease, iteration=an_iteration(1), now=now)
    TrainingJob.objects.filter(pk=job.pk).update(
        state=JobState.FINISHED,
        ended_because="time",
        ended_at=now,
        lease=None,
        leased_until=None,
        steps_done=9,
        charged_s=600.0,
        best_model=a_model(alice, name="first"),
        sb3_zip=store(f"training/{job.public_id}/sb3.zip", bytes(2 * MEGABYTE)),
        log="learned\n",
    )
    job.refresh_from_db()
    return job


class TestStorageQuota:
    def test_every_file_of_a_training_counts(self, alice, bob, oval, now):
        a_training(alice, oval, now)
        job = TRAININGS.claim(worker="w", now=now)
        record_iteration(job=job, lease=job.lease, iteration=an_iteration(1), now=now)
        keep_checkpoint(job=job, lease=job.lease, saved=saved(1), networks=NETWORKS, now=now)
        names = files_of(job)
        assert len(names) == 3
        weight = sum(default_storage.size(name) for name in names)
        assert bytes_of(job) == weight > 0
        assert [(each.shelf.name, each.mb * MEGABYTE) for each in stored_by(alice)] == [("trainings", weight)]
        assert used_by(alice, "storage_mb", now) == weight / MEGABYTE
        assert (used_by(bob, "storage_mb", now), stored_by(bob)) == (0, [])

    def test_a_full_quota_refuses_another_training(self, over, alice, oval, now, settings):
        settings.STORAGE_PER_RACER_MB = 2
        assert used_by(alice, "storage_mb", now) > limit_of(alice, "storage_mb")
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now, name="next")
        assert refused.value.code == "storage_full"
        delete_training(job=over, now=now)
        a_training(alice, oval, now, name="next")

    def test_only_the_newest_sim_traces_are_kept(self, alice, oval, now, monkeypatch):
        monkeypatch.setattr("training.jobs.services.records.SIMTRACE_BYTES_KEPT", 5)
        a_training(alice, oval, now)
        job = TRAININGS.claim(worker="w", now=now)
        for number in range(1, 5):  # of two bytes each
            record_iteration(job=job, lease=job.lease, iteration=an_iteration(number), now=now)
        assert [bool(one.simtrace) for one in job.iterations.all()] == [False, False, True, True]
        assert len(default_storage.listdir(f"training/{job.public_id}")[1]) == 2


class TestDeletedTraining:
    def test_it_leaves_no_file_and_nothing_to_read(self, over, alice, now, django_capture_on_commit_callbacks):
        names = files_of(over)
        with django_capture_on_commit_callbacks(execute=True):
            assert delete_training(job=over, now=now) == 2 * MEGABYTE + 2
        assert len(names) == 2 and not any(default_storage.exists(name) for name in names)
        over.refresh_from_db()
        assert (over.log, over.name, "centre" in over.reward_code) == ("", "deleted", False)
        assert not over.iterations.exists()
        assert not trainings_of(alice).exists() and not visible_trainings(alice).exists()
        assert not can_see_training(alice, over)

    def test_its_minutes_count_until_the_month_is_over(self, over, alice, now):
        delete_training(job=over, now=now)
        assert minutes_used(alice, now) == 10.0, "or whoever deletes would train without end"
        assert forget_deleted(now=now) == 0
        assert forget_deleted(now=now + timedelta(days=31)) == 1
        assert not TrainingJob.objects.exists()

    def test_its_models_stay_unless_they_are_deleted_too(self, over, alice, oval, now):
        other = a_training(alice, oval, now, name="other")
        TrainingJob.objects.filter(pk=other.pk).update(
            state=JobState.STOPPED, ended_because="stopped", ended_at=now, best_model=over.best_model
        )
        delete_training(job=over, now=now)
        assert TrainedModel.objects.get().deleted_at is None
        other.refresh_from_db()
        delete_training(job=other, with_models=True, now=now)
        assert TrainedModel.objects.get().deleted_at == now

    def test_a_waiting_or_running_training_cannot_be_deleted(self, alice, oval, now):
        job = a_training(alice, oval, now)
        for _ in range(2):
            with pytest.raises(UserFault) as refused:
                delete_training(job=job, now=now)
            assert refused.value.code == "training_under_way"
            TRAININGS.claim(worker="w", now=now)
        job.refresh_from_db()
        assert (job.state, job.deleted_at) == (JobState.RUNNING, None)

    def test_a_model_in_a_race_stays(self, over, alice, oval, now):
        race = a_race(now, track=oval)
        submit_model(race=race, racer=alice, model=over.best_model, now=now)
        with pytest.raises(UserFault) as refused:
            delete_training(job=over, with_models=True, now=now)
        assert (refused.value.code, refused.value.params["race"]) == ("training_model_races", race.name)
        over.refresh_from_db()
        assert (over.deleted_at, over.best_model.deleted_at) == (None, None)
        delete_training(job=over, now=now)
        assert TrainedModel.objects.get().deleted_at is None

    def test_a_model_being_evaluated_stays(self, over, alice, oval, now):
        queue_evaluation(owner=alice, model=over.best_model, track=oval, rules=RaceRules(laps=1), now=now)
        with pytest.raises(UserFault) as refused:
            delete_training(job=over, with_models=True, now=now)
        assert refused.value.code == "training_model_drives"
        over.best_model.evaluations.update(state=State.STOPPED, ended_at=now)
        delete_training(job=over, with_models=True, now=now)

    def test_what_another_drives_with_a_shared_model_keeps_nobody_from_deleting_it(self, over, bob, oval, now):
        rules = RaceRules(laps=1)
        queue_evaluation(owner=bob, model=over.best_model, track=oval, rules=rules, checked=True, now=now)
        delete_training(job=over, with_models=True, now=now)
        assert TrainedModel.objects.get().deleted_at is not None

    def test_the_database_refuses_a_deleted_row_with_contents(self, over, now):
        with pytest.raises(IntegrityError), transaction.atomic():
            TrainingJob.objects.filter(pk=over.pk).update(deleted_at=now)

    def test_only_its_owner_may_delete_it(self, over, alice, bob, charlie):
        charlie.is_staff = True
        assert [can_delete_training(racer, over) for racer in (alice, bob, charlie)] == [True, False, False]


class TestDeletionPage:
    @pytest.fixture(autouse=True)
    def _as_alice(self, client, alice):
        client.force_login(alice)

    def test_it_says_what_is_freed_and_deletes(self, client, over):
        page = reverse("training_delete", args=[over.public_id])
        assert page in client.get(over.get_absolute_url()).content.decode()
        assert "2.0 MB" in client.get(page).content.decode()
        answer = client.post(page, {"models": "on"}, follow=True)
        assert "2.0 MB freed" in answer.content.decode()
        assert TrainedModel.objects.get().deleted_at is not None
        assert client.get(page).status_code == 404

    def test_it_says_why_deletion_is_refused(self, client, over, alice, oval):
        race = a_race(timezone.now(), track=oval)
        submit_model(race=race, racer=alice, model=over.best_model, now=timezone.now())
        refused = client.post(reverse("training_delete", args=[over.public_id]), {"models": "on"})
        assert refused.status_code == 409 and "which is still running" in refused.content.decode()
        assert client.get(over.get_absolute_url()).status_code == 200

    def test_others_get_a_404(self, client, over, bob):
        client.force_login(bob)
        assert client.post(reverse("training_delete", args=[over.public_id])).status_code == 404
        assert client.delete(f"/api/v1/trainings/{over.public_id}/").status_code == 404

    def test_it_shows_what_is_stored(self, client, over):
        body = client.get(reverse("usage")).content.decode()
        assert "Your storage" in body and "Trainings: checkpoints" in body

    def test_the_api_deletes_a_training(self, client, over):
        address = f"/api/v1/trainings/{over.public_id}/"
        assert client.get(address).json()["stored_bytes"] == 2 * MEGABYTE + 2
        refused = client.delete(address, {"everything": True}, content_type="application/json")
        assert refused.status_code == 400
        assert client.delete(f"{address}?models=true").status_code == 204
        assert client.get(address).status_code == 404
        assert TrainedModel.objects.get().deleted_at is not None
