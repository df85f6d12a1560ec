"""Highlights of a live event: what the rules choose, and one video of it, made by the worker of videos."""

from __future__ import annotations

import io

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.models import Evaluation
from paddock.errors import UserFault
from races.aftermath.highlights import TracedStep, crashes_in, evaluations_of, moments_of, saves_in, segments_of
from races.models import Entry, Race, Visibility
from tests import factories
from tests.clients import logged_in
from tests.factories import a_racer
from tests.live_shows import an_ended_show
from tests.pages.test_show_browser import round_the_track
from videos.drawing import Form
from videos.models import REEL, Video, VideoState
from videos.scenes import Reel, VideoRun
from videos.selectors import shown_video, videos_of
from videos.services import remove_videos_of_model, request_reel, run_next_video

pytestmark = pytest.mark.django_db
STEP_MS = 1000 // 15


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def now():
    return timezone.now()


def steps(*parts: tuple[int, str, bool]) -> list[TracedStep]:
    """``(how many, status, on_track)`` one after the other, 15 a second."""
    found: list[TracedStep] = []
    for count, status, on_track in parts:
        found += [TracedStep((len(found) + number) * STEP_MS, status, on_track) for number in range(count)]
    return found


def test_a_crash_is_told_once():
    found = steps((30, "in_progress", True), (10, "crashed", True), (5, "pause", True), (10, "in_progress", True))
    assert list(crashes_in(found)) == [(30 * STEP_MS, "crashed")]


def test_a_save_is_a_wheel_beyond_the_line_that_comes_back():
    saved = steps((30, "in_progress", True), (10, "in_progress", False), (30, "in_progress", True))
    assert list(saves_in(saved)) == [(30 * STEP_MS, 40 * STEP_MS)]
    short = steps((30, "in_progress", True), (2, "in_progress", False), (30, "in_progress", True))
    beyond = ((30, "in_progress", True), (10, "in_progress", False))
    lost = steps(*beyond, (5, "off_track", False), (30, "in_progress", True))
    again = steps(*beyond, (5, "in_progress", True), (9, "off_track", False))
    ends = steps(*beyond, (5, "in_progress", True))
    for none in (short, lost, again, ends, []):
        assert list(saves_in(none)) == []


def test_the_fastest_lap_and_the_closest_finish(alice, now):
    event = an_ended_show(now, alice)
    moments = moments_of(event)
    assert [(one.kind, one.run.alias) for one in moments if one.kind in ("fastest", "closest")] == [
        ("fastest", "carl"),
        ("closest", "dora"),
    ]
    captions = [one.caption for one in segments_of(moments, "en")]
    assert "Fastest lap: carl, 0:08.000" in captions
    assert "carl before dora by 0.500 s" in captions
    assert captions != [one.caption for one in segments_of(moments, "ko")]


def test_there_are_none_before_the_end_nor_of_nothing(alice, now):
    event = an_ended_show(now, alice, laps={"bob": (9_000,)}, end=False)
    with pytest.raises(UserFault) as fault:
        moments_of(event)
    assert fault.value.code == "results_not_yet"


def asked(event, by, now) -> Video:
    segments = segments_of(moments_of(event), "en")
    runs = evaluations_of(segments)
    return request_reel(evaluations=runs, segments=segments, by=by, language="en", now=now).video


def test_one_video_is_made_of_them(alice, now, monkeypatch):
    import av

    from videos import drawing

    monkeypatch.setattr(factories, "trace_csv", lambda: round_the_track(factories.a_track().geometry, 2_000))
    event = an_ended_show(now, alice, laps={"bob": (2_000,), "carl": (1_000,)})
    video = asked(event, alice, now)
    assert asked(event, alice, now).pk == video.pk
    small = lambda scenes, path, **how: write_reel(scenes, path, form=Form(320, 180, 5), **how)  # noqa: E731
    write_reel = drawing.write_reel
    monkeypatch.setattr(drawing, "write_reel", small)
    assert run_next_video(worker="test")
    video.refresh_from_db()
    assert (video.state, video.part, video.reason_code) == (VideoState.READY, REEL, "")
    with video.file.open("rb") as file, av.open(io.BytesIO(file.read())) as opened:
        frames = sum(1 for _ in opened.decode(video=0))
    told = sum(one["end_ms"] - one["start_ms"] for one in video.segments)
    assert frames / 5 == pytest.approx(told / 1000, abs=0.5)
    assert shown_video(video).state == "ready"
    run = VideoRun.of(
        Evaluation.objects.select_related("result", "model", "owner", "track").get(pk=video.evaluation_id)
    )
    assert videos_of(run) == []

    # whoever leaves the race is in no video of it any more
    Entry.objects.filter(race=event.race, racer__alias="bob").update(withdrawn_at=now)
    video.refresh_from_db()
    assert shown_video(video).state == "stale"
    model = Evaluation.objects.get(public_id=video.segments[-1]["run"]).model
    assert remove_videos_of_model(model=model) == 1


def test_who_may_ask_and_see(alice, now):
    event = an_ended_show(now, alice, laps={"bob": (2_000,), "carl": (1_000,)})
    address = reverse("live_highlights", args=[event.race.slug])
    page = reverse("live_event", args=[event.race.slug])
    Race.objects.update(visibility=Visibility.INVITATION)
    bob, mallory = Entry.objects.get(race=event.race, racer__alias="bob").racer, a_racer("mallory")
    assert "login" in logged_in(None).post(address).url
    assert logged_in(mallory).post(address).status_code == 404
    assert not Video.objects.exists()
    assert "Make the video" in logged_in(bob).get(page).content.decode()
    assert logged_in(bob).post(address).url == f"{page}#highlights"
    assert Video.objects.get().asked_by == bob
    assert "In queue: number 1." in logged_in(a_racer("stella", is_staff=True)).get(page).content.decode()
    assert logged_in(mallory).get(reverse("video_file", args=[Video.objects.get().public_id])).status_code == 404


def test_a_reel_whose_run_is_gone_is_not_drawn(alice, now):
    event = an_ended_show(now, alice, laps={"bob": (2_000,), "carl": (1_000,)})
    video = asked(event, alice, now)
    video.segments[0]["run"] = "gone"
    reel = Reel.of(video)
    assert reel.fingerprint() == ""
    with pytest.raises(UserFault) as fault:
        reel.scenes()
    assert fault.value.code == "video_run_not_finished"
