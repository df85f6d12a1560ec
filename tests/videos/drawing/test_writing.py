"""The video itself, decoded again: its format, what is seen in it, and what is left when it cannot be made."""

from __future__ import annotations

import io
import resource
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import av
import numpy as np
import pytest

from evaluation.appearance.looks import DEFAULT_COLOUR
from paddock.errors import UserFault
from tests.shared import CHECKOUT
from tests.videos.drawing.runs import OVAL, SMALL, car, driven, lap, scene, with_reset
from videos.drawing import FULL, DrawingStopped, VideoFacts, VideoScene, Words, poster, write_video
from videos.drawing.scene import CARD_MS
from videos.drawing.timeline import prepare
from videos.drawing.writing import Painter, telling

CARD_FRAMES = CARD_MS * 30 // 1000


def still(what, frame: int = 30, form=SMALL) -> np.ndarray:
    """Frame number ``frame`` of a scene, RGB."""
    return Painter(prepare(what, form)).frame(frame)[:, :, ::-1].copy()


def count(picture: np.ndarray, colour: str, tolerance: int = 6) -> int:
    """Pixels of a colour below the bar, left of the small map."""
    rows, columns = picture.shape[:2]
    wanted = np.array(tuple(bytes.fromhex(colour[1:])), int)
    seen = picture[round(rows * 0.14) :, : round(columns * 0.78)].astype(int)
    return int((np.abs(seen - wanted).max(axis=2) <= tolerance).sum())


def boxes_of(data: bytes) -> list[str]:
    """The names of the outermost boxes of an MP4, in order."""
    names, at = [], 0
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at : at + 8])
        names.append(name.decode())
        at += size
    return names


def made(what, **options) -> tuple[VideoFacts, bytes]:
    """A small video of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mp4"
        return write_video(what, path, form=SMALL, **options), path.read_bytes()


def refused(what) -> str:
    with pytest.raises(UserFault) as caught:
        made(what)
    assert str(caught.value)
    return caught.value.code


class TestVideoFile:
    def test_it_is_a_seekable_streamable_h264_mp4(self, tmp_path):
        path = tmp_path / "run.mp4"
        facts = write_video(scene(), path)
        names = boxes_of(path.read_bytes())
        assert names.index("moov") < names.index("mdat")
        with av.open(str(path)) as file:
            (stream,) = file.streams
            assert (stream.codec_context.name, stream.pix_fmt) == ("h264", "yuv420p")
            assert (stream.width, stream.height, stream.average_rate) == (1280, 720, 30)
            keys = [
                packet.pts * stream.time_base for packet in file.demux(stream) if packet.size and packet.is_keyframe
            ]
            assert keys == [0, 2, 4]
        assert (facts.width, facts.height) == FULL[:2]
        assert facts.frames == 60 + CARD_FRAMES
        assert facts.duration_ms == 2000 + CARD_MS
        assert facts.size == path.stat().st_size
        assert [entry.name for entry in tmp_path.iterdir()] == ["run.mp4"]

    def test_every_frame_decodes_at_its_time(self):
        facts, data = made(scene())
        with av.open(io.BytesIO(data)) as file:
            times = [frame.time for frame in file.decode(video=0)]
        assert times == pytest.approx([number / 30 for number in range(facts.frames)])

    def test_colours_survive_encoding(self):
        what = scene(car(colour="#22c55e"))
        with av.open(io.BytesIO(made(what)[1])) as file:
            frame = [frame for frame, _ in zip(file.decode(video=0), range(31), strict=False)][30]
        decoded = frame.to_ndarray(format="rgb24").astype(int)
        painted = still(what).astype(int)
        assert np.abs(decoded - painted).mean() < 3
        assert count(decoded.astype(np.uint8), "#22c55e", 24) > 300

    def test_the_same_run_makes_the_same_bytes(self):
        files = [made(scene(car(), car(driven(2.0, 1.5), 1)))[1] for _ in range(2)]
        assert files[0] == files[1]

    def test_a_poster_is_the_middle_frame(self):
        from PIL import Image

        with Image.open(io.BytesIO(poster(scene(), form=SMALL))) as picture:
            assert (picture.format, picture.size) == ("JPEG", (640, 360))
            shown = np.asarray(picture).astype(int)
        assert np.abs(shown - still(scene(), 30)).mean() < 4

    def test_a_poster_shows_a_moving_car(self):
        from PIL import Image

        what = scene(car(with_reset(driven(3.0, 1.0), 10, 1.0, 3.0)))
        with Image.open(io.BytesIO(poster(what, form=SMALL))) as picture:
            shown = np.asarray(picture)
        middle = still(what, prepare(what, SMALL).driven // 2)
        assert count(middle, "#ff3b55", 40) > 100 > count(shown, "#ff3b55", 40)  # the ring of a car that stands

    def test_a_poster_shows_the_car_on_the_road(self):
        rows = driven(3.0)
        wide = [way for number, way in enumerate(driven(3.0, offset=1.5)) if 15 <= number < 30]
        take = prepare(scene(car([*rows[:15], *wide, *rows[30:]])), SMALL)
        middle, shown = take.driven // 2, telling(take)
        drive = take.hero.drive
        assert not OVAL.on_road(drive.x[middle], drive.y[middle])
        assert OVAL.on_road(drive.x[shown], drive.y[shown])

    def test_the_site_loads_no_encoder(self):
        code = (
            "import sys, django; from django.conf import settings; settings.configure(); import videos.drawing;"
            "print([name for name in ('av', 'cv2', 'PIL', 'scipy', 'shapely') if name in sys.modules])"
        )
        done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"


class TestPicture:
    def test_the_car_is_near_the_middle_in_its_colour(self):
        picture = still(scene(car(colour="#d946ef")))
        rows, columns = np.nonzero((np.abs(picture[46:, :480].astype(int) - (0xD9, 0x46, 0xEF)) < 6).all(axis=2))
        assert len(rows) > 500
        assert abs(np.median(columns) - 320) < 0.3 * 640
        assert abs(np.median(rows) - 157) < 0.25 * 314

    def test_no_text_lies_under_the_browsers_controls(self):
        picture = still(scene()).astype(int)
        letters = (np.abs(picture - (0xEE, 0xF1, 0xF5)) < 8).all(axis=2)
        assert letters[:46].sum() > 200, "the bar with the readings"
        assert not letters[-60:].any()

    def test_another_colour_and_another_shell_look_different(self):
        red, green = (still(scene(car(colour=colour))) for colour in ("#ef4444", "#22c55e"))
        assert count(red, "#ef4444") > 500 > count(green, "#ef4444")
        van, kart = (still(scene(car(colour="#ef4444", shell=shell))) for shell in ("van", "kart"))
        assert count(van, "#ef4444") > 1.5 * count(kart, "#ef4444")

    def test_an_unknown_colour_or_shell_becomes_the_default(self):
        usual = still(scene(car(shell="paddock", colour=DEFAULT_COLOUR)))
        for shell, colour in (("zeppelin", "red"), ("", "#12"), ("paddock", "#gggggg"), ("paddock", "")):
            assert (still(scene(car(shell=shell, colour=colour))) == usual).all()

    def test_a_duel_shows_both_cars_and_their_order(self):
        rival = car(driven(2.0, 1.6), 1, colour="#22c55e", name="Rival")
        alone, duel = still(scene(car(colour="#ef4444"))), still(scene(car(colour="#ef4444"), rival))
        assert count(duel, "#22c55e") > 300 > count(alone, "#22c55e")
        assert count(duel, "#ef4444") > 500

    def test_the_followed_car_is_the_one_in_the_middle(self):
        far = car(driven(2.0, 1.0, 8.0), 1, colour="#22c55e")
        first, second = (still(scene(car(colour="#ef4444"), far, followed=number)) for number in (0, 1))
        assert count(first, "#ef4444") > 500 > 300 > count(first, "#22c55e")
        assert count(second, "#22c55e") > 500 > 300 > count(second, "#ef4444")

    def test_boxes_and_bots_are_visible(self):
        plain = still(scene())
        x, y, yaw = OVAL.point_at(2.6, 0.2)
        box = still(scene(layout={"boxes": [{"fraction": 0.1, "lane": "inner", "x": x, "y": y, "yaw": yaw}]}))
        assert count(box, "#d99a3d") > 500 > count(plain, "#d99a3d")
        bot = still(scene(layout={"bots": [[[x, y, yaw]] * 31]}))
        assert count(bot, "#27445f") > 300 > count(plain, "#27445f")

    def test_a_reset_cuts_to_the_new_place(self):
        rows = with_reset(driven(3.0, 1.0), 30, 2.5, 1.0)
        take = prepare(scene(car(rows)), SMALL)
        drive = take.hero.drive
        apart = np.hypot(np.diff(drive.x), np.diff(drive.y))
        assert (apart > 0.05).sum() == 1 and apart.max() == pytest.approx(2.5, abs=0.1)
        eye = np.hypot(np.diff(take.eye.x), np.diff(take.eye.y))
        assert (eye > 0.3).sum() == 1
        assert drive.standing.sum() == pytest.approx(30, abs=2)

    def test_the_view_glides_over_a_short_reset_but_not_the_car(self):
        take = prepare(scene(car(with_reset(driven(3.0, 1.0), 30, 1.0, 1.0))), SMALL)
        assert np.hypot(np.diff(take.hero.drive.x), np.diff(take.hero.drive.y)).max() > 0.9
        assert np.hypot(np.diff(take.eye.x), np.diff(take.eye.y)).max() < 0.2

    def test_a_car_waiting_after_a_reset_has_a_ring(self):
        what = scene(car(with_reset(driven(3.0, 1.0), 15, 1.0, 2.0), colour="#22c55e"))
        assert count(still(what, 60), "#ff3b55") > count(still(what, 15), "#ff3b55") + 100

    def test_even_the_fastest_car_stays_in_the_picture(self):
        take = prepare(scene(car(driven(8.0, 4.0))), FULL)
        away = np.abs((take.hero.drive.x - take.eye.x, take.hero.drive.y - take.eye.y)).max(axis=1)
        assert away[0] * 330 < 0.4 * 1280 and away[1] * 330 < 0.35 * 628

    def test_any_name_can_be_drawn(self):
        for name in ("x" * 64, "한국어 이름", "Ωé☃🚗", "\x00\u202e\n", "", "אב"):
            assert still(scene(car(name=name), car(None, 1, name=name), title=name, words=Words.translated("ko"))).any()

    def test_the_final_card_shows_the_result(self):
        what = scene(car(laps=[lap(1, 0, 1000), lap(2, 1000, 999, off_tracks=2)]))
        painter = Painter(prepare(what, SMALL))
        driven, coming, there, last = (painter.frame(number).copy().astype(int) for number in (59, 62, 75, 134))
        assert (there == last).all()
        assert np.abs(coming - driven).mean() > 2 and np.abs(coming - there).mean() > 2
        assert last[:20].mean() < 0.6 * driven[:20].mean()
        assert count(last[:, :, ::-1], "#34d17f") > count(driven[:, :, ::-1], "#34d17f")  # the best lap in green


class TestVideoParts:
    def test_a_lap_lasts_as_long_as_it_took(self):
        two = [lap(1, 0, 1200), lap(2, 1200, 800)]
        facts, _ = made(scene(car(laps=two), lap=2))
        assert facts.frames == 24 + CARD_FRAMES
        take = prepare(scene(car(laps=two), lap=2), SMALL)
        assert take.times[0] == 1200 and take.times[-1] == 2000

    def test_a_run_lasts_until_its_last_car_is_done(self):
        take = prepare(scene(car(), car(driven(3.0), 1)), SMALL)
        assert take.times[-1] == pytest.approx(3000)
        assert take.hero.drive.gone[-1] and not take.actors[1].drive.gone[-1]

    def test_an_unknown_lap_is_refused(self):
        with pytest.raises(UserFault) as caught:
            scene(car(), lap=2)
        assert caught.value.code == "video_lap_unknown"
        assert "1 laps" in str(caught.value) and "lap 2" in str(caught.value)

    @pytest.mark.parametrize("cars", [(), tuple(car(number=n) for n in range(5)), (car(), car()), (car(number=1),)])
    def test_an_invalid_set_of_cars_is_refused(self, cars):
        with pytest.raises(UserFault) as caught:
            VideoScene(OVAL, "A race", "Oval", cars)
        assert caught.value.code == "video_no_car"

    def test_a_long_run_is_refused_but_one_short_lap_of_it_is_not(self):
        laps = [lap(1, 0, 2000), lap(2, 2000, 700_000)]
        rows = driven(2.0)
        rows.append(rows[-1]._replace(tstamp=702.0))
        assert refused(scene(car(rows, laps=laps))) == "video_too_long"
        assert refused(scene(car(rows, laps=laps), lap=2)) == "video_too_long"
        assert made(scene(car(rows, laps=laps), lap=1))[0].frames == 60 + CARD_FRAMES


class TestUnusableData:
    @pytest.mark.parametrize(
        "trace",
        [
            b"",
            b"X,Y\n1,2\n",
            b"\xff\x00\n\n,,",
            car(driven(2.0)[:1]).trace,
            car(driven(1.0)).trace.replace(b"0.", b"nan"),
        ],
    )
    def test_a_trace_without_two_rows_is_refused(self, trace):
        broken = car()
        object.__setattr__(broken, "trace", trace)
        assert refused(scene(broken)) == "video_no_steps"

    def test_unreadable_rows_and_rivals_without_trace_are_left_out(self):
        rows = driven(1.0)
        rows[5] = rows[5]._replace(X=float("nan"))
        rows[7] = rows[7]._replace(Y=1e30)
        rows[9] = rows[9]._replace(tstamp=0.0)
        silent = car(None, 1)
        object.__setattr__(silent, "trace", b"")
        facts, _ = made(scene(car(rows), silent))
        assert facts.frames == 30 + CARD_FRAMES

    def test_invalid_laps_and_layouts_are_left_out(self):
        laps = [{"number": 1}, {}, lap(1, 0, 2000)]
        layout = {"bots": [[], [[float("nan")] * 3], [[1.0]]]}
        assert still(scene(car(laps=laps), layout=layout)).any()

    def test_four_cars_six_bots_and_boxes_can_be_drawn(self):
        cars = [car(driven(1.0, 1.0 + 0.3 * number), number, name="x" * 64) for number in range(4)]
        poses = [[list(OVAL.point_at(metres)) for _ in range(16)] for metres in range(6)]
        boxes = [{"x": x, "y": y, "yaw": yaw} for x, y, yaw in (OVAL.point_at(2.0 * k, 0.2) for k in range(8))]
        facts, _ = made(scene(*cars, layout={"bots": poses, "boxes": boxes}))
        assert facts.frames == 30 + CARD_FRAMES

    def test_a_stopped_video_leaves_nothing(self, tmp_path):
        path = tmp_path / "run.mp4"
        path.write_bytes(b"the one before")
        asked = iter(range(1000))
        with pytest.raises(DrawingStopped):
            write_video(scene(), path, is_stopped=lambda: next(asked) == 20, form=SMALL)
        assert [(entry.name, entry.read_bytes()) for entry in tmp_path.iterdir()] == [("run.mp4", b"the one before")]

    def test_a_listeners_error_propagates_and_leaves_nothing(self, tmp_path):
        def fail(share: float) -> None:
            raise RuntimeError("heard enough")

        with pytest.raises(RuntimeError, match="heard enough"):
            write_video(scene(), tmp_path / "run.mp4", on_progress=fail, form=SMALL)
        assert list(tmp_path.iterdir()) == []

    def test_a_missing_folder_is_a_system_error(self, tmp_path):
        with pytest.raises(FileNotFoundError):
            write_video(scene(), tmp_path / "nowhere" / "run.mp4", form=SMALL)

    def test_a_full_disk_leaves_nothing(self, tmp_path):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
        try:
            with pytest.raises(OSError, match="too large"):
                write_video(scene(), tmp_path / "run.mp4", form=SMALL)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert list(tmp_path.iterdir()) == []

    def test_progress_rises_to_one(self):
        shares = []
        made(scene(), on_progress=shares.append)
        assert shares == sorted(shares) and shares[-1] == 1.0
