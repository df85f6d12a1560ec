"""Videos and files of trainings in a bucket that is stopped, slow or short: a 503 where they begin, never half of them
as if it were all."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from core.clock import database_now
from evaluation.services import EVALUATIONS
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer, a_track
from tests.training.jobs import a_trained_one
from videos.models import Video, VideoState
from videos.services import ask_for_video, run_next_video

pytestmark = [pytest.mark.django_db, pytest.mark.slow]
AWAY = ["stopped", "slow"]


@pytest.fixture
def alice(db):
    return a_racer("alice")


@pytest.fixture
def owner(alice):
    client = Client(raise_request_exception=False)
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    return client


@pytest.fixture
def video(s3, alice, video_wakes, wakes) -> Video:
    """Of a run of Alice's, not drawn yet."""
    now = timezone.now()
    return ask_for_video(evaluation=a_driven_run(a_race(now), alice, now), by=alice, language="en", now=now).video


@pytest.mark.parametrize("mood", [*AWAY, "full"])
def test_a_video_that_cannot_be_stored_is_drawn_again(mood, s3, video):
    s3.be(mood)
    run_next_video(worker="w")
    video.refresh_from_db()
    assert video.state == VideoState.WAITING
    s3.be("")
    EVALUATIONS.sweep(now=database_now() + timedelta(minutes=2), wake=False)  # it looks whether the storage is back
    assert run_next_video(worker="w")
    video.refresh_from_db()
    assert video.state == VideoState.READY


@pytest.mark.parametrize("mood", AWAY)
def test_an_unavailable_video_is_a_503(mood, s3, video, owner):
    run_next_video(worker="w")
    for name in ("video.mp4", "still.jpg"):
        assert owner.get(f"/videos/{video.public_id}/{name}").status_code == 200
    s3.be(mood)
    for address in (f"/videos/{video.public_id}/video.mp4", f"/videos/{video.public_id}/still.jpg"):
        assert owner.get(address).status_code == 503, address
    assert owner.get(f"/api/v1/videos/{video.public_id}/file/").status_code == 503
    assert owner.get(f"/evaluations/{video.evaluation.public_id}/").status_code == 200


@pytest.mark.parametrize("mood", [*AWAY, "short"])
def test_unavailable_training_files_are_a_503(mood, s3, alice, owner, trainings_taken_on):
    job = a_trained_one(alice, a_track(), timezone.now())
    parts = ("logs/", "trace/", "sb3/", "package/")
    addresses = [f"/api/v1/trainings/{job.public_id}/{part}" for part in parts]
    assert {owner.get(address).status_code for address in addresses} == {200}
    s3.be(mood)
    found = {address: owner.get(address) for address in addresses}
    assert {address: answer.status_code for address, answer in found.items()} == dict.fromkeys(addresses, 503)
    assert {answer.json()["code"] for answer in found.values()} == {"storage_failed"}
    assert owner.get(job.get_absolute_url()).status_code == 200
