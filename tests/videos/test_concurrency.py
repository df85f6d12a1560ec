"""Asking for videos and drawing them at the same moment: on SQLite here, on PostgreSQL with the rest of this folder."""

from __future__ import annotations

import pytest

from tests.factories import a_race, a_racer, drive, laps
from tests.races.test_concurrency import at_once
from videos.models import Video
from videos.services import VIDEOS, VideoRequest, request_video, run_next_video, stop_video

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def run(alice, now, video_wakes):
    return drive(a_race(now, laps=6), alice, laps(*[9_000] * 6), now).evaluation


def asking(run, racer, now, part="1"):
    return lambda: request_video(evaluation=run, by=racer, part=part, language="en", now=now)


def test_simultaneous_requests_make_one_video(run, now):
    answers = at_once([asking(run, a_racer(), now) for _ in range(5)])
    assert sorted(answer.queued for answer in answers) == [False] * 4 + [True]
    assert Video.objects.count() == 1


def test_a_failed_video_is_requeued_once_for_many_requests(run, alice, now):
    stop_video(video=asking(run, alice, now)().video, now=now)
    answers = at_once([asking(run, a_racer(), now) for _ in range(4)])
    assert sorted(answer.queued for answer in answers) == [False] * 3 + [True]
    assert Video.objects.get().state == "waiting"


def test_simultaneous_requests_cannot_pass_a_limit(run, bob, now, settings):
    settings.VIDEOS_AT_ONCE = 3
    answers = at_once([asking(run, bob, now, part=str(number)) for number in range(1, 7)])
    assert sum(isinstance(answer, VideoRequest) for answer in answers) == 3
    assert answers.count("videos_at_once") == 3
    assert Video.objects.count() == 3


def test_several_workers_share_the_queue(run, alice, bob, now):
    for racer, part in ((alice, "1"), (alice, "2"), (bob, "3")):
        asking(run, racer, now, part=part)()
    claimed = at_once([lambda: VIDEOS.claim(worker="w", now=now) for _ in range(5)])
    assert sorted(video.part for video in claimed if video is not None) == [1, 2, 3]


def test_a_video_stopped_while_ending_is_stopped_or_ready(run, alice, now):
    video = asking(run, alice, now)().video
    answers = at_once([lambda: run_next_video(worker="w"), lambda: stop_video(video=video, now=now)])
    assert not [answer for answer in answers if isinstance(answer, Exception)]
    ended = Video.objects.get()
    assert ended.state in ("ready", "failed")
    assert bool(ended.file) == (ended.state == "ready")
