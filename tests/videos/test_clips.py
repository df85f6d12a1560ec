"""Clips: moments of a run, by other cameras and in other formats."""

from __future__ import annotations

import pytest
from django.test import Client
from django.urls import reverse
from PIL import Image

from evaluation.models import Evaluation
from paddock.errors import UserFault
from tests.clients import logged_in
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from videos.models import CLIPS, Video, VideoState
from videos.responses import file_name
from videos.scenes import PLAIN, ClipForm
from videos.services import request_video, run_next_video

pytestmark = pytest.mark.django_db
MOMENT = ClipForm(1_000, 2_000)


@pytest.fixture
def run(alice, now, video_wakes) -> Evaluation:
    return a_driven_run(a_race(now), alice, now, lap_ms=9_000)


def ask(run, by, now, form=MOMENT, part="whole", language="en"):
    return request_video(evaluation=run, by=by, part=part, language=language, now=now, form=form)


def test_each_moment_camera_and_format_is_a_clip_of_its_own(run, alice, now, settings):
    settings.VIDEOS_AT_ONCE = 9
    forms = (MOMENT, ClipForm(1_000, 2_500), ClipForm(1_000, 2_000, "top"), ClipForm(1_000, 2_000, "top", "webp"))
    clips = [ask(run, alice, now, form) for form in forms]
    assert [clip.video.part for clip in clips] == [CLIPS, CLIPS + 1, CLIPS + 2, CLIPS + 3]
    again = ask(run, alice, now, forms[2])
    assert not again.queued and again.video == clips[2].video
    assert ask(run, alice, now, PLAIN).video.part == 0 and Video.objects.count() == 5


def test_a_lap_by_another_camera_is_the_clip_of_its_moment(run, alice, now):
    second = run.result.laps[1]
    video = ask(run, alice, now, ClipForm(camera="chase"), part="2").video
    assert (video.from_ms, video.to_ms) == (second["start_ms"], second["start_ms"] + second["time_ms"])


@pytest.mark.parametrize(
    ("form", "code"),
    [
        (ClipForm(2_000, 1_000), "video_moment_order"),
        (ClipForm(1_000, 1_400), "video_moment"),
        (ClipForm(-1, 2_000), "video_moment"),
        (ClipForm(1_000, 0), "video_moment_order"),
        (ClipForm(1_000, 10**9), "video_moment"),
        (ClipForm(0, 21_000, format="webp"), "video_animation_too_long"),
        (ClipForm(camera="drone"), "video_camera"),
        (ClipForm(format="gif"), "video_format"),
    ],
)
def test_what_cannot_be_shown_is_refused(form, code, run, alice, now):
    with pytest.raises(UserFault) as refused:
        ask(run, alice, now, form)
    assert refused.value.code == code and not Video.objects.exists()


def test_the_worker_draws_a_clip_as_webp(run, alice, now, commits):
    video = ask(run, alice, now, ClipForm(1_000, 2_000, "chase", "webp")).video
    assert run_next_video(worker="w")
    video.refresh_from_db()
    assert (video.state, video.duration_ms) == (VideoState.READY, 1_000)
    with video.file.open() as file:
        assert Image.open(file).format == "WEBP"
    assert file_name(video) == f"{run.public_id}-clip-1000-2000.webp"
    shown = Client().get(reverse("video_file", args=[video.public_id]))
    assert shown["Content-Type"] == "image/webp" and b"".join(shown.streaming_content)[8:12] == b"WEBP"
    page = Client().get(run.get_absolute_url()).content.decode()
    assert f'src="{reverse("video_file", args=[video.public_id])}" alt=' in page and "0:01.000 – 0:02.000" in page


def test_the_page_asks_for_a_moment(run, alice, now):
    client = logged_in(alice)
    fields = {"what": "0:whole", "from": "1,5", "to": "2.75", "camera": "top", "format": "mp4"}
    client.post(reverse("evaluation_video", args=[run.public_id]), fields)
    video = Video.objects.get()
    assert (video.from_ms, video.to_ms, video.camera, video.format) == (1_500, 2_750, "top", "mp4")
    for nonsense in ("x", "nan", "1e999", "-3"):
        client.post(reverse("evaluation_video", args=[run.public_id]), fields | {"from": nonsense})
    assert Video.objects.count() == 1


def test_a_program_asks_for_a_moment(run, alice, now):
    body = {"part": "whole", "from_ms": 1_000, "to_ms": 2_000, "camera": "chase", "format": "webp"}
    address = reverse("api-videos", args=[run.public_id])
    answer = logged_in(alice).post(address, body, content_type="application/json")
    assert answer.status_code == 202
    shown = {name: answer.json()[name] for name in ("lap", "from_ms", "to_ms", "camera", "format")}
    assert shown == {"lap": None, "from_ms": 1_000, "to_ms": 2_000, "camera": "chase", "format": "webp"}
