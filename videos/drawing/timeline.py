"""A scene prepared for drawing: the moment of every frame and the position of everything in it."""

from dataclasses import dataclass

import numpy as np

from core.cards.lettering import is_drawable
from paddock.errors import UserFault

from .lens import PERSPECTIVE, Lens, lens_of
from .motion import Eye, Motion, Steps, drive_of, eye_of, poses_at, read_steps
from .palette import Colour, bgr
from .scene import BAR, CARD_MS, MAX_SECONDS, PX_PER_M, Form, VideoCar, VideoScene, Words
from .timing import Timing, laps_of


@dataclass(frozen=True)
class Actor:
    """A submitted car and its motion; ``drive``: None for one that never drove."""

    car: VideoCar
    colour: Colour
    steps: Steps
    drive: Motion | None
    timing: Timing

    @property
    def way(self) -> Motion:
        assert self.drive is not None, "it never drove"
        return self.drive


@dataclass(frozen=True)
class FrameTimeline:
    """``times``: ms since the start of the run, one a frame, and the moment of the end, below the card. ``hero``: the
    followed actor. ``bots``: (n, 3) each. ``boxes``: x, y, yaw each. ``eye``: of a picture from above;
    ``lens``: of one in perspective. ``words``: English where fonts lack letters."""

    scene: VideoScene
    form: Form
    times: np.ndarray
    actors: list[Actor]
    hero: Actor
    bots: list[np.ndarray]
    boxes: list[tuple[float, float, float]]
    eye: Eye
    lens: Lens | None
    card_frames: int
    words: Words

    @property
    def frames(self) -> int:
        """The number of frames, with those of the card."""
        return self.driven + self.card_frames

    @property
    def driven(self) -> int:
        """The number of frames before the card."""
        return len(self.times) - 1


def prepare(scene: VideoScene, form: Form) -> FrameTimeline:
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
    actors = []
    for car in scene.cars:
        mine = steps[car.number]
        drive = drive_of(mine, times) if len(mine) > 1 else None
        actors.append(Actor(car, bgr(car.colour), mine, drive, timings[car.number]))
    clock = steps.get(0, hero_steps)  # bots have a pose for each row of car 0
    bots = [poses_at(clock, times, places) for places in scene.layout.get("bots") or ()]
    scale = PX_PER_M * form.height / 720.0
    view_m = form.width / scale, (form.height - BAR * form.height / 720.0) / scale
    return FrameTimeline(
        scene,
        form,
        times,
        actors,
        next(actor for actor in actors if actor.car.number == scene.followed),
        [bot for bot in bots if len(bot)],
        [(float(box["x"]), float(box["y"]), float(box["yaw"])) for box in scene.layout.get("boxes") or ()],
        eye_of(scene.camera, hero_steps, times, form.fps, view_m, scene.track),
        lens_of(scene.camera, hero_steps, times, form.fps, scene.track) if scene.camera in PERSPECTIVE else None,
        round(CARD_MS * form.fps / 1000.0) if scene.window is None else 0,
        scene.words if is_drawable("".join(vars(scene.words).values())) else Words(),
    )
