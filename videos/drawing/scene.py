"""What a video shows and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import NamedTuple

from django.utils.translation import gettext, override
from django.utils.translation import gettext_noop as _

from evaluation.appearance.looks import DEFAULT_COLOUR, Shell
from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import MAX_CARS
from paddock.simulator.layout import LayoutDocument
from paddock.simulator.results import LapDocument

MAX_SECONDS = 600  # of a run; of a longer one a video shows a single lap
CARD_MS = 2500  # the card with the figures at the end

PX_PER_M = 330.0  # of a picture of 720 lines, at usual zoom; the car is then 109 px long
BAR = 92  # px of 720 lines: the height of the bar above


class DrawingStopped(Exception):
    """The caller's ``is_stopped`` returned true; the video is removed."""


@dataclass(frozen=True)
class Words:
    """The words of the picture; their defaults are English."""

    lap: str = _("Lap")
    best: str = _("Best")
    last: str = _("Last")
    average: str = _("Average")
    total: str = _("Total")
    speed: str = _("Speed")
    steering: str = _("Steering")
    off_tracks: str = _("Off tracks")
    crashes: str = _("Crashes")
    resets: str = _("Resets")
    off_track: str = _("off track")
    crashed: str = _("crashed")
    stood_still: str = _("stood still")
    reversed: str = _("drove backwards")

    @classmethod
    def translated(cls, language: str) -> Words:
        """The words in a language of the site ("en", "ko")."""
        with override(language):
            return cls(**{word.name: gettext(str(word.default)) for word in fields(cls)})


@dataclass(frozen=True)
class VideoCar:
    """One submitted car of the run.

    ``number``: 0 for the evaluation's own model, rivals from 1. ``shell``: one of
    :class:`~evaluation.appearance.looks.Shell`, ``colour``: ``#rrggbb``; any other value becomes the default.
    ``trace``: its sim-trace (CSV, not gzipped).
    """

    number: int
    name: str
    shell: str = Shell.PADDOCK.value
    colour: str = DEFAULT_COLOUR
    trace: bytes = b""
    laps: Sequence[LapDocument] = ()


@dataclass(frozen=True)
class VideoScene:
    """A run as a video shows it.

    ``track``: in the driven direction (``geometry.in_direction``). ``title``, ``subtitle``: race and track. ``cars``:
    one to four; ``followed``: the ``number`` of the one that the picture follows. ``layout``: see
    :func:`evaluation.running.results.read_layout`. ``order``: the numbers of the cars, winner first (empty: as in
    ``cars``). ``lap``: show this lap of the followed car only (from 1). ``window``: show the run between these ms only,
    without the card at the end, with ``caption`` below. ``camera``: from above "follow" (around the followed car) or
    "top" (the whole track), in perspective "chase" (behind it), "onboard" or "trackside". ``fastest_sectors_ms``: of
    the race, for the purple sectors.

    Raises UserFault ``video_no_car`` for no car, more than four, or two with one number; ``video_lap_unknown``.
    """

    track: TrackGeometry
    title: str
    subtitle: str
    cars: Sequence[VideoCar]
    followed: int = 0
    layout: LayoutDocument = field(default_factory=lambda: LayoutDocument(boxes=[]))
    order: Sequence[int] = ()
    lap: int | None = None
    window: tuple[int, int] | None = None
    camera: str = "follow"
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
        return next(car for car in self.cars if car.number == self.followed)


class Form(NamedTuple):
    """Size of the picture (px, both even) and frames a second."""

    width: int = 1280
    height: int = 720
    fps: int = 30


FULL = Form()
ANIMATED = Form(640, 360, 15)


@dataclass(frozen=True)
class VideoFacts:
    """A written file. ``size``: bytes; ``drawing_s``, ``encoding_s``: processor seconds of this process."""

    frames: int
    duration_ms: int
    width: int
    height: int
    size: int
    drawing_s: float = 0.0
    encoding_s: float = 0.0
