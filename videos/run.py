"""What of a finished run a video can show, and what one shows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from django.conf import settings

from evaluation.competitors import CompetitorRow, car_rows
from evaluation.models import Evaluation, State
from evaluation.services.results import read_layout, read_trace
from paddock.errors import UserFault

from .hooks import runs
from .models import REEL, WHOLE, Video

if TYPE_CHECKING:
    from videos.drawing import VideoScene

FORMAT = 2  # raise it whenever the picture changes: videos of another format are made anew


@dataclass(frozen=True)
class VideoRun:
    """A finished run with all that its videos show: its cars, winner first."""

    evaluation: Evaluation
    cars: Sequence[CompetitorRow]

    @classmethod
    def of(cls, evaluation: Evaluation, cars: Sequence[CompetitorRow] | None = None) -> VideoRun:
        """The run of an evaluation. ``cars`` saves looking them up. Raises UserFault("video_run_not_finished")."""
        if evaluation.state != State.FINISHED:
            raise UserFault("video_run_not_finished")
        return cls(evaluation, car_rows(evaluation) if cars is None else cars)

    def car(self, number: int) -> CompetitorRow:
        """The car of this number. Raises UserFault("car_number")."""
        found = next((row for row in self.cars if row.number == number), None)
        if found is None:
            known = ", ".join(str(row.number) for row in sorted(self.cars, key=lambda row: row.number))
            raise UserFault("car_number", car=str(number)[:20], known=known)
        return found

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

    def length_ms(self, car: int, part: int) -> int:
        """How long the part takes, in simulated milliseconds."""
        if part == WHOLE:
            return self.evaluation.result.simulated_ms
        return next(lap["time_ms"] for lap in self.car(car).result.laps if lap["number"] == part)

    @cached_property
    def shown(self) -> list[Any]:
        """All that a picture of this run shows, whichever part and car: what changes it makes another video."""
        track = self.evaluation.track
        return [
            FORMAT,
            *runs().titles(self.evaluation, "en"),
            track.fingerprint,
            self._direction,
            *(
                [row.number, row.place, row.label, *row.look, row.result.trace_sha256]
                for row in sorted(self.cars, key=lambda row: row.number)
            ),
        ]

    def fingerprint(self, car: int, part: int, language: str) -> str:
        """64 hexadecimal digits that change with anything that the video would show: names, looks, traces, words, the
        form of the picture. How fast others have become since (the purple of sectors) is not part of it."""
        shown = json.dumps([car, part, language, *self.shown])
        return hashlib.sha256(shown.encode()).hexdigest()

    def is_current(self, video: Video) -> bool:
        """Whether a ready video shows what it would show if it were made now."""
        if video.part == REEL:
            from .reel import Reel

            return video.fingerprint == Reel.of(video).fingerprint()
        return video.fingerprint == self.fingerprint(video.car, video.part, video.language)

    def scene(self, car: int, part: int, language: str) -> VideoScene:
        """What is to be drawn. Reads the stored traces. Raises PlatformFault("storage_failed"), UserFault."""
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
                for row in sorted(self.cars, key=lambda row: row.number)
            ],
            followed=car,
            layout=read_layout(evaluation.result),
            order=list(evaluation.result.order),
            lap=part or None,
            fastest_sectors_ms=runs().fastest_sectors_ms(evaluation),
            words=Words.translated(language),
        )

    @property
    def _direction(self) -> str:
        return self.evaluation.spec["rules"].get("direction", "ccw")


def best_lap(laps: Sequence[dict[str, Any]]) -> int | None:
    """The number of the fastest complete lap, the earlier of two; None without any."""
    complete = [lap for lap in laps if lap["complete"]]
    return min(complete, key=lambda lap: (lap["time_ms"], lap["number"]))["number"] if complete else None


def check_language(language: str) -> str:
    """A language of the site. Raises UserFault("video_language")."""
    known = [code for code, _ in settings.LANGUAGES]
    if language not in known:
        raise UserFault("video_language", language=language[:20], known=", ".join(known))
    return language
