"""How long videos are kept, and that their files go with them, whatever takes them away."""

from __future__ import annotations

import os
from datetime import timedelta

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage

from evaluation.garage.services import delete_model
from evaluation.models import Evaluation
from races.models import Submission
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from videos.models import Video, VideoState
from videos.services import VIDEOS, forget_lost_file, note_watched, purge_videos, request_video, run_next_video

pytestmark = pytest.mark.django_db


@pytest.fixture
def video(alice, now, video_wakes, commits) -> Video:
    """A ready one."""
    run = a_driven_run(a_race(now), alice, now)
    made = request_video(evaluation=run, by=alice, language="en", now=now).video
    assert run_next_video(worker="w")
    Video.objects.filter(pk=made.pk).update(watched_at=now)
    made.refresh_from_db()
    return made


def files_are_there(video: Video) -> list[bool]:
    return [default_storage.exists(name) for name in (video.file.name, video.poster.name)]


def test_a_long_unwatched_video_goes_with_its_files(video, now, settings):
    days = timedelta(days=settings.VIDEO_DAYS)
    assert purge_videos(now=now + days) == 0
    assert files_are_there(video) == [True, True]
    assert purge_videos(now=now + days + timedelta(seconds=1)) == 1
    assert files_are_there(video) == [False, False]
    assert not Video.objects.exists()


def test_a_watched_video_is_kept_and_noted_once_an_hour(video, now, settings, django_assert_num_queries):
    with django_assert_num_queries(0):  # a guest who reads on takes no lock of the database
        note_watched(video=video, now=now + timedelta(minutes=59))
    video.refresh_from_db()
    assert video.watched_at == now
    later = now + timedelta(days=settings.VIDEO_DAYS)
    note_watched(video=video, now=later)
    assert purge_videos(now=later + timedelta(days=settings.VIDEO_DAYS)) == 0
    assert Video.objects.get().watched_at == later


def test_an_old_failed_video_is_removed_a_waiting_one_stays(video, now, alice, settings):
    from paddock.errors import UserFault

    run = video.evaluation
    request_video(evaluation=run, by=alice, part="1", language="en", now=now)
    failed = VIDEOS.claim(worker="w", now=now)
    VIDEOS.fail(pk=failed.pk, lease=failed.lease, fault=UserFault("video_no_steps"), now=now)
    waiting = request_video(evaluation=run, by=alice, part="3", language="en", now=now).video
    purge_videos(now=now + timedelta(days=settings.VIDEO_DAYS, seconds=1))
    assert list(Video.objects.all()) == [waiting]


def test_deleting_a_model_deletes_its_videos(video, now, alice):
    other = a_driven_run(a_race(now), alice, now)
    kept = request_video(evaluation=other, by=alice, language="en", now=now).video
    delete_model(model=video.evaluation.model, now=now)
    assert list(Video.objects.all()) == [kept]
    assert files_are_there(video) == [False, False]


def test_deleting_a_rival_deletes_the_video(video, now, bob):
    from evaluation.models import EvaluationRival
    from tests.factories import a_model

    rival = a_model(bob)
    EvaluationRival.objects.create(evaluation=video.evaluation, number=1, model=rival, metadata=rival.metadata)
    delete_model(model=rival, now=now)
    assert not Video.objects.exists()
    assert files_are_there(video) == [False, False]


def test_deleting_an_evaluation_deletes_its_videos(video):
    Submission.objects.all().delete()
    Evaluation.objects.get(pk=video.evaluation_id).delete()
    assert not Video.objects.exists()
    assert files_are_there(video) == [False, False]


def test_deleting_a_requester_keeps_the_video(alice, bob, now, video_wakes, commits):
    run = a_driven_run(a_race(now), alice, now)
    video = request_video(evaluation=run, by=bob, language="en", now=now).video
    bob.delete()
    video.refresh_from_db()
    assert video.asked_by is None


def test_a_video_whose_file_is_lost_can_be_asked_for_again(video, now, alice):
    video.file.storage.delete(video.file.name)
    assert forget_lost_file(video=video, now=now)
    assert not forget_lost_file(video=video, now=now)
    assert default_storage.exists(video.poster.name) is False
    video.refresh_from_db()
    assert (video.state, video.reason_code) == (VideoState.FAILED, "video_file_lost")
    assert request_video(evaluation=video.evaluation, by=alice, language="en", now=now).queued


def test_unreferenced_files_are_removed_after_a_day(video, now):
    orphan = default_storage.save("videos/left-behind.mp4", ContentFile(b"half a video"))
    path = default_storage.path(orphan)
    stamp = (now - timedelta(hours=23)).timestamp()
    os.utime(path, (stamp, stamp))
    purge_videos(now=now)
    assert default_storage.exists(orphan)
    purge_videos(now=now + timedelta(hours=2))
    assert not default_storage.exists(orphan)
    assert files_are_there(video) == [True, True]
