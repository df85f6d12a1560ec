"""Videos and files of trainings in a bucket that is stopped, slow or short: a 503 where they begin, never half of them
as if it were all."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from datetime import timedelta

import boto3
import pytest
from botocore.config import Config
from botocore.exceptions import ReadTimeoutError
from django.test import Client
from django.utils import timezone

from core.database.clock import database_now
from evaluation import stored_files
from evaluation.running.queue.jobs import EVALUATIONS
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer, a_track
from tests.shared import CHECKOUT
from tests.training.jobs import a_trained_one
from videos.models import Video, VideoState
from videos.services import request_video, run_next_video

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
    return request_video(evaluation=a_driven_run(a_race(now), alice, now), by=alice, language="en", now=now).video


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


class TestPatience:
    """Of the site's own client: a bucket that is silent holds a thread for seconds, not for minutes."""

    def test_a_silent_bucket_is_asked_twice_for_twenty_seconds_at_most(self, tmp_path):
        code = (
            "import json; from django.conf import settings\n"
            "patience = settings.STORAGES['default']['OPTIONS']['client_config']\n"
            "print(json.dumps([patience.connect_timeout, patience.read_timeout, patience.retries]))"
        )
        ours = {"DJANGO_SETTINGS_MODULE": "config.settings", "STORAGE": "s3://a-bucket", "PADDOCK_DATA": str(tmp_path)}
        environment = os.environ | ours
        printed = subprocess.check_output([sys.executable, "-c", code], cwd=CHECKOUT, env=environment, text=True)
        connect_s, read_s, retries = json.loads(printed.splitlines()[-1])
        with socket.create_server(("127.0.0.1", 0)) as silent:
            client = boto3.client(
                "s3",
                endpoint_url=f"http://127.0.0.1:{silent.getsockname()[1]}",
                region_name="us-east-1",
                aws_access_key_id="a-key",
                aws_secret_access_key="a-secret",
                config=Config(read_timeout=0.1, retries=retries),
            )
            sent = []
            client.meta.events.register("before-send.s3", lambda **said: sent.append(said["request"].url))
            with pytest.raises(ReadTimeoutError):
                client.head_object(Bucket="a-bucket", Key="a-file")
        assert len(sent) == 2 and len(sent) * max(connect_s, read_s) <= 20


def test_of_two_who_store_the_same_file_one_deletes_only_its_own(s3, db):
    first, second = (stored_files.store("networks/a.onnx", b"the same car") for _ in range(2))
    stored_files.delete(second)
    assert stored_files.read(first) == b"the same car"
