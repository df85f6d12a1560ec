"""The queue of videos: claimed once, taken from workers that disappear, given up in the end, stored once."""

from __future__ import annotations

import errno
import os
from datetime import timedelta
from functools import partial
from pathlib import Path

import pytest
from django.core.files.storage import default_storage
from django.db import IntegrityError, OperationalError, transaction

from core.events import Event
from core.jobs.models import Outage
from paddock.errors import PlatformFault, UserFault
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from videos import drawing, tasks
from videos.drawing import VideoFacts
from videos.models import Video, VideoState
from videos.services import VIDEOS, DrawnVideo, finish_video, request_video, run_next_video, stop_video

pytestmark = pytest.mark.django_db
LEASE = timedelta(seconds=30)


@pytest.fixture
def run(alice, now, video_wakes):
    return a_driven_run(a_race(now), alice, now)


@pytest.fixture
def waiting(run, alice, now) -> Video:
    return request_video(evaluation=run, by=alice, language="en", now=now).video


@pytest.fixture
def claimed(waiting, now) -> Video:
    return VIDEOS.claim(worker="w1", now=now)


def ident(video: Video) -> dict:
    return {"pk": video.pk, "lease": video.lease}


@pytest.fixture
def drawn(tmp_path):
    """Makes a video of these bytes."""
    return partial(a_drawn_video, tmp_path / "video.mp4")


def a_drawn_video(path: Path, content: bytes = b"a video") -> DrawnVideo:
    path.write_bytes(content)
    facts = VideoFacts(frames=30, duration_ms=1000, width=1280, height=720, size=len(content))
    return DrawnVideo(path, b"a still", facts, "0" * 64)


def stored() -> set[str]:
    try:
        return {f"videos/{name}" for name in default_storage.listdir("videos")[1]}
    except FileNotFoundError:
        return set()


def ours(video: Video) -> set[str]:
    return {name for name in stored() if video.public_id in name}


class TestClaim:
    def test_it_takes_the_longest_waiting_video_once(self, run, alice, now):
        first = request_video(evaluation=run, by=alice, part="1", language="en", now=now - timedelta(minutes=1)).video
        second = request_video(evaluation=run, by=alice, part="2", language="en", now=now).video
        assert [VIDEOS.claim(worker="w", now=now) for _ in range(3)] == [first, second, None]

    def test_a_claim_is_a_lease(self, claimed, now):
        assert (claimed.state, claimed.attempt, claimed.worker) == (VideoState.DRAWING, 1, "w1")
        assert claimed.leased_until == now + LEASE
        later = now + timedelta(seconds=20)
        assert VIDEOS.beat(**ident(claimed), progress=40, now=later)
        claimed.refresh_from_db()
        assert (claimed.progress, claimed.leased_until) == (40, later + LEASE)

    def test_a_lost_claim_writes_nothing(self, claimed, now, drawn):
        assert VIDEOS.sweep(now=now + LEASE + timedelta(seconds=1)).waiting == 1
        other = VIDEOS.claim(worker="w2", now=now + LEASE)
        assert other.attempt == 2
        lost = ident(claimed)
        assert not VIDEOS.beat(**lost, progress=1, now=now)
        assert not finish_video(**lost, drawn=drawn(), now=now)
        assert not VIDEOS.fail(**lost, fault=UserFault("video_no_steps"), now=now)
        assert not VIDEOS.release(**lost, now=now)
        assert ours(claimed) == set()
        assert finish_video(**ident(other), drawn=drawn(), now=now)
        assert len(ours(claimed)) == 2
        ready = Event.objects.get(kind="video.ready")
        assert (ready.subject, ready.data) == (claimed.evaluation.public_id, {"video": claimed.public_id})


class TestEnd:
    def test_a_good_end_stores_video_and_poster(self, claimed, now, drawn):
        assert finish_video(**ident(claimed), drawn=drawn(b"a longer video"), now=now)
        claimed.refresh_from_db()
        assert (claimed.state, claimed.size, claimed.duration_ms) == (VideoState.READY, 14, 1000)
        assert (claimed.watched_at, claimed.lease) == (now, None)
        with claimed.file.open("rb") as file, claimed.poster.open("rb") as still:
            assert (file.read(), still.read()) == (b"a longer video", b"a still")
        assert ours(claimed) == {claimed.file.name, claimed.poster.name}

    @pytest.mark.parametrize("code", ["storage_failed", "lease_expired", "internal_error"])
    def test_our_fault_is_retried_for_as_long_as_it_takes(self, claimed, now, settings, code):
        """It pauses ever longer, an hour at most."""
        settings.EVALUATION_MAX_ATTEMPTS = 2
        pauses, at = [], now
        for _ in range(8):
            assert VIDEOS.fail(**ident(claimed), fault=PlatformFault(code), now=at, detail="disk")
            claimed.refresh_from_db()
            assert (claimed.state, claimed.kills) == (VideoState.WAITING, 0)
            pauses.append((claimed.not_before - at).total_seconds() if claimed.not_before else 0)
            assert not pauses[-1] or VIDEOS.claim(worker="w", now=at) is None
            at = claimed.not_before or at
            claimed = VIDEOS.claim(worker="w", now=at)
        assert pauses == [0, 4, 16, 64, 256, 1024, 3600, 3600]
        assert claimed.operator_detail.startswith(f"Attempt 1: {code}. disk\n")

    def test_a_video_is_given_up_only_when_ours_fails_and_others_pass(self, run, claimed, alice, now, settings, drawn):
        settings.EVALUATION_MAX_ATTEMPTS = 2
        at = now + timedelta(seconds=1)
        request_video(evaluation=run, by=alice, part="1", language="en", now=at)
        assert finish_video(**ident(VIDEOS.claim(worker="w2", now=at)), drawn=drawn(), now=at)
        for attempt in (1, 2):
            Video.objects.filter(state=VideoState.READY).update(ended_at=at)  # as if another had been drawn just now
            assert VIDEOS.fail(**ident(claimed), fault=PlatformFault("internal_error"), now=at)
            claimed.refresh_from_db()
            assert claimed.kills == attempt
            at += timedelta(hours=2)
            claimed = VIDEOS.claim(worker="w", now=at) or claimed
        assert (claimed.state, claimed.reason_code) == (VideoState.FAILED, "video_gave_up")
        assert claimed.is_platform_fault

    def test_a_storage_outage_counts_no_attempt(self, claimed, now):
        outage = Outage.objects.create(part="storage", since=now, look_at=now + timedelta(seconds=5))
        Video.objects.update(attempt=99)
        assert VIDEOS.fail(**ident(claimed), fault=PlatformFault("storage_failed"), now=now)
        claimed.refresh_from_db()
        assert (claimed.state, claimed.attempt) == (VideoState.WAITING, 98)
        assert VIDEOS.claim(worker="w", now=now) is None
        outage.delete()
        assert VIDEOS.claim(worker="w", now=now) == claimed

    def test_a_fault_that_no_retry_changes_is_final(self, claimed, now):
        fault = UserFault("video_no_steps")
        assert VIDEOS.fail(**ident(claimed), fault=fault, now=now)
        claimed.refresh_from_db()
        assert (claimed.state, claimed.reason_code, claimed.ended_at) == (VideoState.FAILED, fault.code, now)

    def test_a_worker_shutting_down_costs_no_attempt(self, claimed, now):
        assert VIDEOS.release(**ident(claimed), now=now)
        claimed.refresh_from_db()
        assert (claimed.state, claimed.attempt, claimed.progress) == (VideoState.WAITING, 0, 0)

    def test_a_stop_by_its_requester_is_final(self, claimed, now):
        assert stop_video(video=claimed, now=now)
        assert (claimed.state, claimed.reason_code) == (VideoState.FAILED, "video_stopped")
        assert not stop_video(video=claimed, now=now)
        assert VIDEOS.claim(worker="w", now=now) is None

    def test_a_worker_dying_after_storing_leaves_no_file(self, claimed, now, monkeypatch, drawn):
        from videos.services import queue as jobs

        class Killed(BaseException):
            pass

        def store_and_die(*args):
            real(*args)
            raise Killed

        real = jobs.store
        monkeypatch.setattr(jobs, "store", store_and_die)
        with pytest.raises(Killed):
            finish_video(**ident(claimed), drawn=drawn(), now=now)
        assert len(ours(claimed)) == 2
        VIDEOS.sweep(now=now + LEASE + timedelta(seconds=1))
        assert ours(claimed) == set()

    def test_a_poster_that_cannot_be_stored_keeps_no_video_either(self, claimed, now, monkeypatch, drawn):
        real = default_storage._wrapped.save if hasattr(default_storage, "_wrapped") else default_storage.save

        def full(name, content, **more):
            if name.endswith(".jpg"):
                raise OSError("No space left on device")
            return real(name, content, **more)

        monkeypatch.setattr(type(default_storage._wrapped), "save", lambda self, *args, **more: full(*args, **more))
        with pytest.raises(PlatformFault) as refused:
            finish_video(**ident(claimed), drawn=drawn(), now=now)
        assert refused.value.code == "storage_failed"
        assert ours(claimed) == set()


class TestDatabaseConstraints:
    @pytest.mark.parametrize(
        "changes",
        [
            {"state": "lost"},
            {"state": "drawing"},
            {"state": "ready"},
            {"state": "failed"},
            {"state": "failed", "reason_code": "video_stopped"},
            {"file": "videos/x.mp4"},
            {"progress": 101},
            {"car": 4},
            {"language": ""},
        ],
    )
    def test_a_contradictory_row_is_refused(self, waiting, changes):
        with pytest.raises(IntegrityError), transaction.atomic():
            Video.objects.filter(pk=waiting.pk).update(**changes)

    def test_a_ready_video_without_a_file_is_refused(self, claimed, now, drawn):
        finish_video(**ident(claimed), drawn=drawn(), now=now)
        for column in ("file", "poster", "sha256", "fingerprint"):
            with pytest.raises(IntegrityError), transaction.atomic():
                Video.objects.filter(pk=claimed.pk).update(**{column: ""})


class TestVideoWorker:
    def test_it_draws_what_the_row_says(self, waiting, monkeypatch):
        scenes = []

        def look(scene, out, *, on_progress, is_stopped):
            scenes.append(scene)
            on_progress(0.5)
            assert not is_stopped()
            out.write_bytes(b"video")
            return VideoFacts(frames=1, duration_ms=1, width=2, height=2, size=4)

        monkeypatch.setattr(drawing, "write_video", look)
        assert run_next_video(worker="w")
        (scene,) = scenes
        assert (scene.followed, scene.lap, scene.order) == (0, 2, [0])
        assert (scene.title, scene.subtitle) == (waiting.evaluation.submission.entry.race.name, "Paddock Oval")
        (car,) = scene.cars
        assert (car.name, car.shell, car.number) == ("alice", "paddock", 0)
        assert car.trace.startswith(b"episode,steps") and len(car.laps) == 3
        assert not run_next_video(worker="w")

    def test_it_writes_in_the_requested_language(self, run, alice, now, monkeypatch):
        scenes = []
        monkeypatch.setattr(drawing, "write_video", lambda scene, out, **more: scenes.append(scene))
        request_video(evaluation=run, by=alice, language="ko", now=now)
        run_next_video(worker="w")
        assert scenes[0].words.lap == "랩"

    def test_it_hands_back_its_video_when_told_to_stop(self, waiting, monkeypatch):
        told = []

        def draws(scene, out, *, on_progress, is_stopped):
            told.append(True)
            assert is_stopped()
            raise drawing.DrawingStopped

        monkeypatch.setattr(drawing, "write_video", draws)
        assert run_next_video(worker="w", interrupted=lambda: bool(told))
        waiting.refresh_from_db()
        assert (waiting.state, waiting.attempt) == (VideoState.WAITING, 0)

    def test_it_logs_errors_for_operators_only(self, waiting, monkeypatch):
        def draws(scene, out, *, on_progress, is_stopped):
            raise ZeroDivisionError("a bug")

        monkeypatch.setattr(drawing, "write_video", draws)
        assert run_next_video(worker="w")
        waiting.refresh_from_db()
        assert (waiting.state, waiting.reason_code, waiting.kills) == (VideoState.WAITING, "", 0)
        assert "ZeroDivisionError" in waiting.operator_detail and waiting.reason == ""

    @pytest.mark.parametrize(
        ("error", "code"),
        [
            (OSError(errno.ENOSPC, "No space left on device"), "storage_failed"),
            (OperationalError("could not extend file: No space left on device"), "lease_expired"),
        ],
        ids=["of this machine", "of the database"],
    )
    def test_a_full_disk_never_fails_a_video_for_good(self, waiting, monkeypatch, settings, error, code):
        """Shorter videos, and rows that need no new page, still fit."""

        def draws(scene, out, *, on_progress, is_stopped):
            raise error

        monkeypatch.setattr(drawing, "write_video", draws)
        monkeypatch.setattr(type(VIDEOS), "others_passed", lambda self, job: True)
        for _ in range(settings.EVALUATION_MAX_ATTEMPTS + 1):
            assert run_next_video(worker="w")
            Video.objects.update(not_before=None)
        waiting.refresh_from_db()
        assert (waiting.state, waiting.kills) == (VideoState.WAITING, 0)
        assert code in waiting.operator_detail and "No space left" in waiting.operator_detail

    def test_it_leaves_nothing_and_clears_a_killed_workers_files(self, waiting, settings):
        folder = Path(settings.FILE_UPLOAD_TEMP_DIR)
        ages = {"video-new": 0, "video-old": 90_000}
        for name, seconds in ages.items():
            (folder / name).mkdir()
            (folder / name / "video.mp4").write_bytes(b"half a video")
            stamp = (folder / name).stat().st_mtime - seconds
            os.utime(folder / name, (stamp, stamp))
        assert run_next_video(worker="w")
        assert [path.name for path in folder.glob("video-*")] == ["video-new"]
        (folder / "video-new" / "video.mp4").unlink()
        (folder / "video-new").rmdir()

    def test_a_worker_without_an_encoder_claims_nothing(self, waiting, monkeypatch, caplog):
        """Another machine may have one; until then it is nobody's fault who asked."""
        from videos.services import worker as work

        monkeypatch.setattr(work, "ENCODER", "no-such-encoder")
        assert not run_next_video(worker="w")
        waiting.refresh_from_db()
        assert (waiting.state, waiting.attempt) == (VideoState.WAITING, 0)
        assert "no-such-encoder" in caplog.text

    def test_it_draws_one_and_sends_a_wake_up_for_the_next(self, run, alice, now, video_wakes, commits):
        for part in ("1", "2"):
            request_video(evaluation=run, by=alice, part=part, language="en", now=now)
        video_wakes.clear()
        assert tasks.draw.apply().get()
        assert len(video_wakes) == 1
        assert tasks.draw.apply().get()
        assert not tasks.draw.apply().get()
        assert set(Video.objects.values_list("state", flat=True)) == {"ready"}

    def test_it_draws_nothing_when_videos_are_switched_off(self, waiting, settings):
        settings.VIDEOS = False
        assert not tasks.draw.apply().get()
        waiting.refresh_from_db()
        assert waiting.state == VideoState.WAITING

    def test_the_sweep_wakes_it_while_something_waits(self, waiting, video_wakes, commits):
        video_wakes.clear()
        assert tasks.sweep.apply().get() == 1
        assert len(video_wakes) == 1
