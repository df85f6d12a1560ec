"""Two workers that are killed at random: every video is made, once, and no file is left over."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from django.core.files.storage import default_storage
from django.db import connection
from django.utils import timezone

from tests.evaluation.processes import environment, kill_session
from tests.factories import a_race, drive, laps
from tests.shared import CHECKOUT
from videos.models import Video, VideoState
from videos.services import request_video

LAPS = 20


@pytest.mark.soak
@pytest.mark.django_db(transaction=True)
@pytest.mark.xdist_group("workers")
def test_every_video_is_made_once_whatever_crashes(alice, video_wakes, wakes, settings, tmp_path):
    settings.VIDEOS_AT_ONCE = settings.VIDEOS_A_DAY = 100
    now = timezone.now()
    race = a_race(now, laps=LAPS)
    run = drive(race, alice, laps(*[1000 + number for number in range(LAPS)]), now).evaluation
    for number in range(1, LAPS + 1):
        for language in ("en", "ko"):
            request_video(evaluation=run, by=alice, part=str(number), language=language, now=now)
    log = tmp_path / "storm.log"
    with log.open("wb") as output:
        storm = subprocess.Popen(
            [sys.executable, "-m", "tests.races.video_storm", "2"],
            cwd=CHECKOUT,
            env=environment("redis://127.0.0.1:1/0"),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        assert storm.wait(120) == 0, log.read_text()[-4000:]
    finally:
        kill_session(storm.pid)
        storm.wait()
    connection.close()
    said = log.read_text()
    videos = list(Video.objects.all())
    assert {video.state for video in videos} == {VideoState.READY}
    kept = set()
    for video in videos:
        with video.file.open("rb") as file:
            assert file.read() == f"{race.name} 0 {video.part} ['alice']".encode()
        kept |= {video.file.name, video.poster.name}
    mine = {video.public_id for video in videos}
    there = {f"videos/{name}" for name in default_storage.listdir("videos")[1] if name.partition("-")[0] in mine}
    assert there == kept and len(kept) == 2 * len(videos) == 4 * LAPS
    # the weather was bad enough
    codes = [int(code) for code in re.findall(r"^exit (-?\d+)$", said, re.M)]
    assert codes.count(-9) == said.count("crash ") >= 4
    assert {code for code in codes if code != -9} == {0}
    assert "Traceback" not in said and "locked" not in said
