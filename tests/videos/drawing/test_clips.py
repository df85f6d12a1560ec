"""Moments of a run by other cameras, and animated pictures."""

from __future__ import annotations

import numpy as np
from PIL import Image

from tests.videos.drawing.runs import OVAL, SMALL, car, driven, lap, scene
from videos.drawing import write_animation, write_video
from videos.drawing.scene import ANIMATED
from videos.drawing.timeline import prepare
from videos.drawing.view import View
from videos.drawing.writing import MOST_ANIMATED_BYTES, Painter


def seconds(count: float, **more):
    """A car that drives around the oval for so long."""
    return scene(car(driven(count), laps=[lap(1, 0, round(count * 1000))]), **more)


def test_the_camera_from_above_sees_the_whole_track_in_every_frame():
    take = prepare(seconds(4.0, camera="top"), SMALL)
    view = View(take, SMALL.width, SMALL.height - 60)
    picture = np.zeros((SMALL.height, SMALL.width, 3), np.uint8)
    for frame in (0, 60, 119):
        view.paint(picture, frame)
        places = np.concatenate([view.place(line) for line in OVAL.outlines])
        assert (places >= 0).all() and (places <= (SMALL.width, SMALL.height - 60)).all()
        assert (take.eye.x[frame], take.eye.zoom[frame]) == (take.eye.x[0], take.eye.zoom[0])


def test_the_camera_around_the_car_draws_as_before():
    plain, chosen = (
        Painter(prepare(what, SMALL)).frame(30).copy() for what in (seconds(2.0), seconds(2.0, camera="follow"))
    )
    assert (plain == chosen).all()


def test_an_animation_is_a_webp_that_repeats(tmp_path):
    facts = write_animation(seconds(3.0, window=(500, 2500)), tmp_path / "clip.webp")
    drawn = Image.open(tmp_path / "clip.webp")
    assert (drawn.format, drawn.size, drawn.n_frames) == ("WEBP", ANIMATED[:2], 2 * ANIMATED.fps)
    assert drawn.info["loop"] == 0 and facts.duration_ms == 2000
    first = np.asarray(drawn.convert("RGB"), int)
    drawn.seek(20)
    assert np.abs(np.asarray(drawn.convert("RGB"), int) - first).max() > 50
    assert facts.size == (tmp_path / "clip.webp").stat().st_size < MOST_ANIMATED_BYTES


def test_an_animation_that_is_too_large_has_less_quality(tmp_path):
    what = seconds(1.0, window=(0, 1000))
    best = write_animation(what, tmp_path / "best.webp")
    smaller = write_animation(what, tmp_path / "smaller.webp", most_bytes=best.size - 1)
    assert smaller.size < best.size
    assert [one.name for one in tmp_path.iterdir() if one.name.startswith(".")] == []


def test_the_same_scene_makes_the_same_bytes(tmp_path):
    what = seconds(1.0, window=(0, 700), camera="chase")
    for name in ("a.webp", "b.webp"):
        write_animation(what, tmp_path / name)
    assert (tmp_path / "a.webp").read_bytes() == (tmp_path / "b.webp").read_bytes()


def test_a_clip_in_mp4_shows_its_moment_without_the_card(tmp_path):
    facts = write_video(seconds(3.0, window=(1000, 2000), camera="top"), tmp_path / "clip.mp4", form=SMALL)
    assert (facts.frames, facts.duration_ms) == (30, 1000)
