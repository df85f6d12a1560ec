"""What a car sees while it is trained: told by the trainer, bounded, kept while it runs, shown beside the map."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from paddock.rules.hyperparameters import PPO, SAC
from paddock.simulator.rewards import follow_centre_line
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.training.jobs import a_training
from tests.training.specs import a_spec
from training.jobs.services.queue import TRAININGS
from training.jobs.services.worker import sight_document
from training.models import JobState, TrainingJob
from training.trainer.messages import Sight, sight_of
from training.trainer.network import NetworkLayout

PICTURE = bytes(range(160)) * 120
SAID = {"steering": -12.5, "speed": 1.2, "value": 3.0}


def test_a_sight_is_kept_as_a_picture_that_browsers_read():
    told = sight_document(Sight(PICTURE, -12.5, 1.2, 3.0))
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(told["png"]), np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (120, 160) and picture.tobytes() == PICTURE
    assert (told["steering"], told["speed"], told["value"]) == (-12.5, 1.2, 3.0)


@pytest.mark.parametrize(
    ("said", "blobs"),
    [
        (SAID, [PICTURE[1:]]),
        (SAID, []),
        (SAID, [PICTURE, PICTURE]),
        ({**SAID, "steering": "left"}, [PICTURE]),
        ({**SAID, "value": float("nan")}, [PICTURE]),
        ({"steering": 0.0, "speed": 1.0}, [PICTURE]),
    ],
)
def test_what_is_no_sight_is_refused(said, blobs):
    with pytest.raises((ValueError, KeyError)):
        sight_of(said, blobs)


def test_a_value_beyond_telling_is_told_as_none():
    assert sight_of({**SAID, "value": None}, [PICTURE]).value is None


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_looking_on_changes_nothing_that_is_learned(algorithm):
    pytest.importorskip("torch", reason="training is not installed: make training")
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    from training.trainer.cars import TrainingCars
    from training.trainer.learners import Learner
    from training.trainer.observations import look

    class Silent(BaseCallback):
        def _on_step(self) -> bool:
            return True

    track = stadium(1.5)
    spec = a_spec(track, algorithm)
    layout = NetworkLayout.of(spec.metadata)
    senses = list(layout.senses)
    cars = TrainingCars(spec, track, [follow_centre_line] * 2, senses, 0)
    learner = Learner(spec, layout, cars, Silent())
    cars.reset()
    row = look(senses, {name: one[None] for name, one in cars.env.readings(0).items()})
    before = torch.random.get_rng_state()
    (output, value), (again, value_again) = (learner.consider(row) for _ in range(2))
    cars.close()
    assert np.array_equal(output, again) and np.array_equal(output, learner.act(row)[0])
    assert value == value_again and np.isfinite(value)
    assert torch.equal(before, torch.random.get_rng_state())


@pytest.mark.django_db
@pytest.mark.usefixtures("training_wakes")
class TestShown:
    @pytest.fixture
    def job(self, alice, oval, now) -> TrainingJob:
        job = a_training(alice, oval, now)
        claimed = TRAININGS.claim(worker="w", now=now)
        columns = TRAININGS.progress_columns(
            {"steps": 100, "seconds": 1.0, "seen": sight_document(Sight(PICTURE, -12.5, 1.2, 3.0))}
        )
        assert columns["progress"] == {"steps": 100, "seconds": 1.0}
        TrainingJob.objects.filter(pk=claimed.pk).update(**columns)
        job.refresh_from_db()
        return job

    def test_the_page_and_its_poll_show_it_and_an_unchanged_one_costs_nothing(self, job, alice, client):
        client.force_login(alice)
        page = client.get(job.get_absolute_url()).content.decode()
        assert job.seen["png"] in page and "to the right" in page
        live = client.get(f"{job.get_absolute_url()}live/", {"seen": "x"})
        assert job.seen["png"] in live.content.decode()
        mark = live.context["mark"]
        assert client.get(f"{job.get_absolute_url()}live/", {"seen": mark}).status_code == 204

    def test_a_progress_without_it_leaves_it(self, job):
        assert "seen" not in TRAININGS.progress_columns({"steps": 200, "seconds": 2.0})

    def test_one_that_is_over_shows_none(self, job, alice, client):
        TrainingJob.objects.filter(pk=job.pk).update(
            state=JobState.STOPPED, ended_because="stopped", lease=None, leased_until=None, ended_at=job.created_at
        )
        client.force_login(alice)
        assert "training-sight" not in client.get(job.get_absolute_url()).content.decode()
