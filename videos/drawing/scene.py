"""What a video shows and what comes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

from django.utils.translation import gettext as _
from django.utils.translation import override

from evaluation.looks import DEFAULT_COLOUR, Shell
from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import MAX_CARS

MAX_SECONDS = 600  # of a run that a video shows; of a longer one it shows a single lap
CARD_MS = 2500  # the card with the figures stands so long at the end

PX_PER_M = 330.0  # of a picture of 720 lines, at usual zoom; the car is then 109 px long
BAR = 92  # px of 720 lines: the height of the bar above

_NO_LAYOUT: Mapping[str, list] = MappingProxyType({})


class Stopped(Exception):
    """The caller's ``is_stopped`` said so: nothing is left of the video."""


@dataclass(frozen=True)
class Words:
    """The few words of the picture, in the language of whoever asked for the video."""

    lap: str = "Lap"
    laps: str = "Laps"
    best: str = "Best"
    last: str = "Last"
    average: str = "Average"
    total: str = "Total"
    speed: str = "Speed"
    steering: str = "Steering"
    off_tracks: str = "Off tracks"
    crashes: str = "Crashes"
    resets: str = "Resets"
    off_track: str = "off track"
    crashed: str = "crashed"
    stood_still: str = "stood still"
    reversed: str = "drove backwards"

    @classmethod
    def translated(cls, language: str) -> Words:
        """The words in a language of the site ("en", "ko")."""
        with override(language):
            return cls(
                lap=_("Lap"),
                laps=_("Laps"),
                best=_("Best"),
                last=_("Last"),
                average=_("Average"),
                total=_("Total"),
                speed=_("Speed"),
                steering=_("Steering"),
                off_tracks=_("Off tracks"),
                crashes=_("Crashes"),
                resets=_("Resets"),
                off_track=_("off track"),
                crashed=_("crashed"),
                stood_still=_("stood still"),
                reversed=_("drove backwards"),
            )


@dataclass(frozen=True)
class VideoCar:
    """One submitted car of the run.

    ``number``: 0 for the evaluation's own model, rivals from 1. ``name``: a stranger's, of any length. ``shell``: one
    of :class:`evaluation.looks.Shell`, ``colour``: ``#rrggbb``; what is neither becomes the default. ``trace``: its
    sim-trace (CSV, not gzipped). ``laps``: dicts as in ``Result.laps``.
    """

    number: int
    name: str
    shell: str = Shell.PADDOCK.value
    colour: str = DEFAULT_COLOUR
    trace: bytes = b""
    laps: Sequence[Mapping[str, Any]] = ()


@dataclass(frozen=True)
class VideoScene:
    """A run as a video shows it.

    ``track``: in the driven direction (``geometry.in_direction``). ``title``, ``subtitle``: say the race and the track.
    ``cars``: one to four; ``followed``: the ``number`` of the one that the picture follows. ``layout``: boxes and bots
    as in ``EvaluationOutcome.layout`` (:func:`evaluation.services.results.read_layout`), in metres and radians, a bot
    with a pose for each row of car 0's trace. ``order``: the numbers of the cars, winner first (empty: as in ``cars``).
    ``lap``: show this lap of the followed car only (from 1); None for the whole run. ``window``: show what
    happened from the first of these ms to the second alone, without the card at the end; ``caption``: what is written
    below it. ``fastest_sectors_ms``: of
    everybody in the race, for the purple of the sectors; None or empty where the run has no race.

    Raises UserFault ``video_no_car`` for no car, more than four, or two with one number; ``video_lap_unknown``.
    """

    track: TrackGeometry
    title: str
    subtitle: str
    cars: Sequence[VideoCar]
    followed: int = 0
    layout: Mapping[str, list] = field(default_factory=lambda: _NO_LAYOUT)
    order: Sequence[int] = ()
    lap: int | None = None
    window: tuple[int, int] | None = None
    caption: str = ""
    fastest_sectors_ms: Sequence[int | None] = ()
    words: Words = field(default_factory=Words)

    def __post_init__(self) -> None:
        numbers = [car.number for car in self.cars]
        if not 1 <= len(numbers) <= MAX_CARS or len(set(numbers)) < len(numbers) or self.followed not in numbers:
            raise UserFault("video_no_car", number=self.followed, most=MAX_CARS)
        if self.lap is not None and self.lap not in [lap.get("number") for lap in self.hero.laps]:
            raise UserFault("video_lap_unknown", lap=self.lap, laps=len(self.hero.laps))

    @property
    def hero(self) -> VideoCar:
        """The car that the picture follows."""
        return next(car for car in self.cars if car.number == self.followed)


class Form(NamedTuple):
    """Size of the picture (px, both even; everything in it grows with the height) and frames a second."""

    width: int = 1280
    height: int = 720
    fps: int = 30


FULL = Form()


@dataclass(frozen=True)
class VideoFacts:
    """What was written. ``size``: bytes; ``drawing_s``, ``encoding_s``: processor seconds of this process."""

    frames: int
    duration_ms: int
    width: int
    height: int
    size: int
    drawing_s: float = 0.0
    encoding_s: float = 0.0
