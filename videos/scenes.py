"""The content of a video: the scenes of one finished run, or of a reel of moments of several runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from django.conf import settings

from evaluation.models import Evaluation, State
from evaluation.running.competitors import CompetitorRow, car_rows
from evaluation.running.results import read_layout, read_trace
from paddock.errors import UserFault
from paddock.simulator.results import LapDocument

from .hooks import runs
from .models import CLIPS, REEL, WHOLE, Video, VideoCamera, VideoFormat

if TYPE_CHECKING:
    from videos.drawing import VideoScene

# Raise FORMAT whenever the picture changes, REEL_FORMAT or CLIP_FORMAT when that of a reel or a clip alone does: such
# videos are made anew.
FORMAT, REEL_FORMAT, CLIP_FORMAT = 2, 1, 2
LEAST_MOMENT_MS, LONGEST_ANIMATION_MS = 500, 20_000
RELATED = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")


@dataclass(frozen=True)
class ClipForm:
    """How a part of a run is shown. ``to_ms``: 0 for the whole part, else that of a clip from ``from_ms`` on (simulated
    milliseconds of the run); ``camera``, ``format``: see :class:`.models.VideoCamera`, :class:`.models.VideoFormat`."""

    from_ms: int = 0
    to_ms: int = 0
    camera: str = VideoCamera.FOLLOW.value
    format: str = VideoFormat.MP4.value

    @classmethod
    def of(cls, video: Video) -> ClipForm:
        return cls(video.from_ms, video.to_ms, video.camera, video.format)

    def checked(self, run: VideoRun, car: int, part: int) -> ClipForm:
        """The form with the moment of ``part`` if it has none and is no plain video. Raises UserFault ``video_camera``,
        ``video_format``, ``video_moment``, ``video_moment_order``, ``video_animation_too_long``."""
        if self.camera not in VideoCamera.values:
            raise UserFault("video_camera", camera=self.camera[:20], known=", ".join(VideoCamera.values))
        if self.format not in VideoFormat.values:
            raise UserFault("video_format", format=self.format[:20], known=", ".join(VideoFormat.values))
        if self == PLAIN:
            return self
        form, simulated_ms = self, run.evaluation.result.simulated_ms
        if not (self.from_ms or self.to_ms):
            start_ms = run.start_ms(car, part)
            form = replace(self, from_ms=start_ms, to_ms=start_ms + run.length_ms(car, part))
        length_ms = form.to_ms - form.from_ms
        within = 0 <= form.from_ms < simulated_ms and 0 <= form.to_ms <= simulated_ms
        if within and length_ms <= 0:
            raise UserFault("video_moment_order")
        if not within or length_ms < LEAST_MOMENT_MS:
            raise UserFault("video_moment", least=LEAST_MOMENT_MS / 1000, seconds=f"{simulated_ms / 1000:g}")
        if form.format == VideoFormat.WEBP and length_ms > LONGEST_ANIMATION_MS:
            raise UserFault("video_animation_too_long", limit=LONGEST_ANIMATION_MS // 1000)
        return form


PLAIN = ClipForm()


@dataclass(frozen=True)
class VideoRun:
    """A finished run. ``cars``: winner first."""

    evaluation: Evaluation
    cars: Sequence[CompetitorRow]

    @classmethod
    def of(cls, evaluation: Evaluation, cars: Sequence[CompetitorRow] | None = None) -> VideoRun:
        """The run of an evaluation. ``cars``: spares a query. Raises UserFault("video_run_not_finished")."""
        if evaluation.state != State.FINISHED:
            raise UserFault("video_run_not_finished")
        return cls(evaluation, car_rows(evaluation) if cars is None else cars)

    def car(self, number: int) -> CompetitorRow:
        """The car of this number. Raises UserFault("car_number")."""
        found = next((row for row in self.cars if row.number == number), None)
        if found is None:
            known = ", ".join(str(row.number) for row in self._by_number)
            raise UserFault("car_number", car=str(number)[:20], known=known)
        return found

    @property
    def _by_number(self) -> list[CompetitorRow]:
        return sorted(self.cars, key=lambda row: row.number)

    def part(self, car: int, word: str) -> int:
        """The part that ``word`` names: "whole", "best" or the number of a lap. Raises UserFault ``video_part``,
        ``video_no_best_lap``, ``video_lap_unknown``, ``car_number``."""
        laps = self.car(car).result.laps
        if word == "whole":
            return WHOLE
        if word == "best":
            best = best_lap(laps)
            if best is None:
                raise UserFault("video_no_best_lap", car=car)
            return best
        if not (word.isascii() and word.isdecimal()):
            raise UserFault("video_part", part=word[:20])
        number = int(word[:6])
        if number not in [lap["number"] for lap in laps]:
            raise UserFault("video_lap_unknown", lap=number, laps=len(laps))
        return number

    def start_ms(self, car: int, part: int) -> int:
        """Where the part begins in the run, in simulated milliseconds."""
        laps = self.car(car).result.laps
        return next((lap["start_ms"] for lap in laps if lap["number"] == part), 0)

    def length_ms(self, car: int, part: int) -> int:
        """The length of the part in simulated milliseconds."""
        if part == WHOLE:
            return self.evaluation.result.simulated_ms
        return next(lap["time_ms"] for lap in self.car(car).result.laps if lap["number"] == part)

    @cached_property
    def shown(self) -> list[object]:
        """Everything of this run that a picture of any part shows, for the fingerprint."""
        track = self.evaluation.track
        return [
            FORMAT,
            *runs().titles(self.evaluation, "en"),
            track.fingerprint,
            self._direction,
            *([row.number, row.place, row.label, *row.look, row.result.trace_sha256] for row in self._by_number),
        ]

    def fingerprint(self, car: int, part: int, language: str, form: ClipForm = PLAIN) -> str:
        """sha-256 (hex) of everything that the video shows, but for the purple of sectors."""
        clip = [] if form == PLAIN else [asdict(form), CLIP_FORMAT]
        shown = json.dumps([car, part, language, *self.shown, *clip])
        return hashlib.sha256(shown.encode()).hexdigest()

    def scene(self, car: int, part: int, language: str, form: ClipForm = PLAIN) -> VideoScene:
        """The scene to draw, with the stored traces. Raises PlatformFault("storage_failed"), UserFault."""
        from videos.drawing import VideoCar, VideoScene, Words

        evaluation = self.evaluation
        title, subtitle = runs().titles(evaluation, language)
        return VideoScene(
            track=evaluation.track.geometry.in_direction(self._direction),
            title=title,
            subtitle=subtitle,
            cars=[
                VideoCar(
                    number=row.number,
                    name=row.label,
                    shell=row.look.shell,
                    colour=row.look.colour,
                    trace=read_trace(row.result),
                    laps=row.result.laps,
                )
                for row in self._by_number
            ],
            followed=car,
            layout=read_layout(evaluation.result),
            order=list(evaluation.result.order),
            lap=part if WHOLE < part < CLIPS else None,
            window=(form.from_ms, form.to_ms) if form.to_ms else None,
            camera=form.camera,
            fastest_sectors_ms=runs().fastest_sectors_ms(evaluation),
            words=Words.translated(language),
        )

    @property
    def _direction(self) -> str:
        return self.evaluation.spec["rules"].get("direction", "ccw")


def best_lap(laps: Sequence[LapDocument]) -> int | None:
    """The number of the fastest complete lap, the earlier of two; None without any."""
    complete = [lap for lap in laps if lap["complete"]]
    return min(complete, key=lambda lap: (lap["time_ms"], lap["number"]))["number"] if complete else None


def check_language(language: str) -> str:
    """A language of the site. Raises UserFault("video_language")."""
    known = [code for code, _ in settings.LANGUAGES]
    if language not in known:
        raise UserFault("video_language", language=language[:20], known=", ".join(known))
    return language


@dataclass(frozen=True)
class Segment:
    """A moment of a run (by its public id) in simulated ms. ``caption``: in the video's language."""

    run: str
    car: int
    start_ms: int
    end_ms: int
    caption: str

    @property
    def length_ms(self) -> int:
        return self.end_ms - self.start_ms


@dataclass(frozen=True)
class Reel:
    segments: Sequence[Segment]
    language: str

    @classmethod
    def of(cls, video: Video) -> Reel:
        return cls([Segment(**kept) for kept in video.segments or ()], video.language)

    @cached_property
    def _runs(self) -> dict[str, VideoRun]:
        wanted = {one.run for one in self.segments}
        found = Evaluation.objects.filter(public_id__in=wanted, state=State.FINISHED).select_related(*RELATED)
        return {one.public_id: VideoRun.of(one) for one in found}

    def fingerprint(self) -> str:
        """sha-256 (hex) of everything that the video shows; "" once a run is gone or may no longer be shown with the
        others."""
        if not self.segments or not all(one.run in self._runs for one in self.segments):
            return ""
        if not runs().shown_together([one.run for one in self.segments]):
            return ""
        shown = [
            FORMAT,
            REEL_FORMAT,
            self.language,
            [[asdict(one), self._runs[one.run].shown] for one in self.segments],
        ]
        return hashlib.sha256(json.dumps(shown).encode()).hexdigest()

    def scenes(self) -> list[VideoScene]:
        """The scenes to draw, with the stored traces. Raises UserFault("video_run_not_finished") without a run,
        PlatformFault("storage_failed")."""
        if not self.fingerprint():
            raise UserFault("video_run_not_finished")
        return [
            replace(
                self._runs[one.run].scene(one.car, WHOLE, self.language),
                window=(one.start_ms, one.end_ms),
                caption=one.caption,
            )
            for one in self.segments
        ]


def is_current(video: Video, run: VideoRun) -> bool:
    """Whether a ready video shows the present state of ``run``, the first one of a reel."""
    if video.part == REEL:
        return video.fingerprint == Reel.of(video).fingerprint()
    return video.fingerprint == run.fingerprint(video.car, video.part, video.language, ClipForm.of(video))
