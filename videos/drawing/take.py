"""A scene made ready: every frame's moment, and where everything is in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paddock.errors import UserFault

from .lettering import is_drawable
from .motion import Eye, Motion, Steps, drive_of, follow, poses_at, read_steps
from .palette import Colour, bgr
from .scene import BAR, CARD_MS, MAX_SECONDS, PX_PER_M, Form, VideoCar, VideoScene, Words
from .timing import Timing, laps_of


@dataclass(frozen=True)
class Actor:
    """A submitted car with its way; ``drive`` is None for one that never drove."""

    car: VideoCar
    colour: Colour
    steps: Steps
    drive: Motion | None
    timing: Timing

    @property
    def way(self) -> Motion:
        """The drive of a car that drove."""
        assert self.drive is not None, "it never drove"
        return self.drive


@dataclass(frozen=True)
class Take:
    """``times``: ms since the start of the run, one a frame, and the moment of the end, over which the card is laid.
    ``actors``: as in the scene, the followed one is ``hero``. ``bots``: (n, 3) each. ``boxes``: x, y, yaw each.
    ``words``: the scene's, or English ones where fonts here lack letters of them."""

    scene: VideoScene
    form: Form
    times: np.ndarray
    actors: list[Actor]
    hero: Actor
    bots: list[np.ndarray]
    boxes: list[tuple[float, float, float]]
    eye: Eye
    card_frames: int
    words: Words

    @property
    def frames(self) -> int:
        """How many frames there are, those of the card too."""
        return self.driven + self.card_frames

    @property
    def driven(self) -> int:
        """How many frames there are before the card."""
        return len(self.times) - 1


def prepare(scene: VideoScene, form: Form) -> Take:
    """Read the traces and lay out the frames. Raises UserFault ``video_no_steps`` and ``video_too_long``."""
    steps = {car.number: read_steps(car.trace) for car in scene.cars}
    hero_steps = steps[scene.followed]
    if len(hero_steps) < 2:
        raise UserFault("video_no_steps")
    timings = {car.number: Timing(laps_of(car.laps), scene.fastest_sectors_ms) for car in scene.cars}
    start, end = 0.0, max(float(one.t[-1]) for one in steps.values() if len(one))
    laps = timings[scene.followed].laps
    if scene.lap is not None:
        lap = next((lap for lap in laps if lap.number == scene.lap), None)
        if lap is None:
            raise UserFault("video_lap_unknown", lap=scene.lap, laps=len(laps))
        start, end = float(lap.start_ms), float(lap.end_ms)
    if scene.window is not None:
        start, end = max(start, float(scene.window[0])), min(end, float(scene.window[1]))
    if not 0.0 <= start < end or start > hero_steps.t[-1]:
        raise UserFault("video_no_steps")
    if end - start > 1000.0 * MAX_SECONDS:
        raise UserFault("video_too_long", seconds=round((end - start) / 1000.0), limit=MAX_SECONDS)
    frames = max(1, round((end - start) * form.fps / 1000.0))
    times = np.append(start + np.arange(frames) * (1000.0 / form.fps), end)
    actors = [
        Actor(
            car,
            bgr(car.colour),
            steps[car.number],
            drive_of(steps[car.number], times) if len(steps[car.number]) > 1 else None,
            timings[car.number],
        )
        for car in scene.cars
    ]
    clock = steps.get(0, hero_steps)  # bots have a pose for each row of car 0
    bots = [poses_at(clock, times, places) for places in scene.layout.get("bots") or ()]
    return Take(
        scene,
        form,
        times,
        actors,
        next(actor for actor in actors if actor.car.number == scene.followed),
        [bot for bot in bots if len(bot)],
        [(float(box["x"]), float(box["y"]), float(box["yaw"])) for box in scene.layout.get("boxes") or ()],
        follow(hero_steps, times, form.fps, _view_m(form)),
        round(CARD_MS * form.fps / 1000.0) if scene.window is None else 0,
        scene.words if is_drawable("".join(vars(scene.words).values())) else Words(),
    )


def _view_m(form: Form) -> tuple[float, float]:
    """How many metres of the ground the picture shows, across and up."""
    scale = PX_PER_M * form.height / 720.0
    return form.width / scale, (form.height - BAR * form.height / 720.0) / scale
