"""The main picture: the road from above with boxes, bots and cars, around the followed car."""

import math
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from core.cards.lettering import mask, shortened
from evaluation.appearance.looks import Shell
from paddock.simulator.solids import box as box_solid

from . import palette, shapes
from .brush import Sticker, dim, disc, fill, fixed, stroke
from .ground import Ground
from .motion import CRASHED, IMMOBILIZED, OFF_TRACK, REVERSED, Motion
from .palette import Colour, mixed
from .scene import PX_PER_M, Words
from .timeline import Actor, FrameTimeline

TAIL_S = 1.6
_TAIL_HALF_M = 0.016
_TAIL_STEP = 5  # frames of one colour
_SHADOW = np.array((0.014, -0.018))  # m
_RING_M = 0.27
_GONE = 0.65  # transparency of a car whose run is over
_GRID_M = 1.0
_CHEVRON = np.array([(0.055, 0.0), (-0.04, 0.04), (-0.018, 0.0), (-0.04, -0.04)])
_HULL = shapes.above(Shell.COUPE)


class View:
    """Paints the picture below the bar. ``height``: of that part, px."""

    def __init__(self, take: FrameTimeline, width: int, height: int) -> None:
        self._take = take
        self._unit = take.form.height / 720.0
        self._size = (width, height)
        self._middle = np.array((width / 2.0, height / 2.0))
        widest = PX_PER_M * self._unit * float(take.eye.zoom.min())
        self._reach = float(np.hypot(*self._middle)) / widest
        self._ground = Ground(take.scene.track, self._reach + 0.1)
        self._backdrop = np.empty((height, width, 3), np.uint8)
        self._backdrop[:] = palette.GROUND
        self._named = len(take.actors) > 1

    def paint(self, picture: np.ndarray, frame: int) -> None:
        """Paint frame number ``frame`` onto the lower rows of ``picture``."""
        picture = picture[-self._size[1] :]
        np.copyto(picture, self._backdrop)
        eye = self._take.eye
        self._at = np.array((eye.x[frame], eye.y[frame]))
        self._scale = PX_PER_M * self._unit * float(eye.zoom[frame])
        self._grid(picture)
        for patch in self._ground.around(*self._at):
            points = fixed(self.place(patch.corners))
            outlines = [points[part] for part in patch.parts]
            cv2.fillPoly(picture, outlines, patch.colour, cv2.LINE_AA, 4)
        for box in self._take.boxes:
            self._box(picture, *box)
        for bot in self._take.bots:
            self._bot(picture, bot[frame])
        actors = [actor for actor in self._take.actors if actor.drive is not None]
        actors.sort(key=lambda actor: actor is self._take.hero)
        for actor in actors:
            self._tail(picture, actor, frame)
        for actor in actors:
            self._car(picture, actor, frame)
        for actor in actors:
            self._tags(picture, actor, frame)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Places (n, 2) in metres as px of the picture."""
        return (points - self._at) * (self._scale, -self._scale) + self._middle

    def _seen(self, x: float, y: float, reach_m: float = 0.6) -> bool:
        (px, py), far = self.place(np.array((x, y))), reach_m * self._scale
        return -far < px < self._size[0] + far and -far < py < self._size[1] + far

    def _grid(self, picture: np.ndarray) -> None:
        """A grid of metres on the field, which shows motion beside the road."""
        reach = self._middle / self._scale
        lines = []
        for axis in (0, 1):
            first = math.ceil((self._at[axis] - reach[axis]) / _GRID_M)
            last = math.floor((self._at[axis] + reach[axis]) / _GRID_M)
            for number in range(first, last + 1):
                ends = np.array((self._at - reach, self._at + reach))
                ends[:, axis] = number * _GRID_M
                lines.append(self.place(ends))
        stroke(picture, lines, palette.GRID, self._unit, closed=False)

    def _stand(self, x: float, y: float, yaw: float) -> tuple[np.ndarray, np.ndarray]:
        """(turn, middle): ``outline @ turn + middle`` maps an outline in metres around a thing's middle to px."""
        cos, sin = math.cos(yaw) * self._scale, math.sin(yaw) * self._scale
        return np.array(((cos, -sin), (-sin, -cos))), self.place(np.array((x, y)))

    def _turned(self, outline: np.ndarray, x: float, y: float, yaw: float) -> np.ndarray:
        """An outline in metres around a thing's middle, in px."""
        turn, middle = self._stand(x, y, yaw)
        return outline @ turn + middle

    def _box(self, picture: np.ndarray, x: float, y: float, yaw: float) -> None:
        if not self._seen(x, y):
            return
        solid = box_solid(x, y, yaw)
        along, across = solid.half_length, solid.half_width
        corners = np.array([(along, across), (-along, across), (-along, -across), (along, -across)])
        outline = self._turned(corners, x, y, yaw)
        dim(picture, [self._turned(corners, x + 2.5 * _SHADOW[0], y + 2.5 * _SHADOW[1], yaw)], 0.55)
        fill(picture, [outline], palette.BOX)
        lid = np.array([(-along, 0.0), (along, 0.0)])
        tape = np.array([(-along, 0.022), (along, 0.022), (along, -0.022), (-along, -0.022)])
        fill(picture, [self._turned(tape, x, y, yaw)], mixed(palette.BOX, palette.TEXT, 0.35))
        stroke(picture, [self._turned(lid, x, y, yaw)], mixed(palette.BOX, palette.BOX_LINE, 0.6), self._unit, False)
        stroke(picture, [outline], palette.BOX_LINE, 2 * self._unit)

    def _bot(self, picture: np.ndarray, pose: np.ndarray) -> None:
        x, y, yaw = pose.tolist()
        if self._seen(x, y):
            self._shell(picture, _HULL, (x, y, yaw, 0.0), palette.BOT_BODY, palette.BOT, plain=True)
            fill(picture, [self._turned(_CHEVRON, x, y, yaw)], palette.BOT)

    def _car(self, picture: np.ndarray, actor: Actor, frame: int) -> None:
        drive = actor.way
        x, y, yaw, steer = (float(column[frame]) for column in (drive.x, drive.y, drive.yaw, drive.steer))
        if not self._seen(x, y):
            return
        standing, faded = bool(drive.standing[frame]), _GONE if drive.gone[frame] else 0.0
        shell, edge = shapes.above(actor.car.shell), palette.ACCENT if standing else palette.TEXT
        self._shell(picture, shell, (x, y, yaw, steer), actor.colour, edge, faded=faded)
        if standing:
            self._ring(picture, x, y, actor, frame)

    def _shell(
        self,
        picture: np.ndarray,
        shell: shapes.Above,
        place: tuple[float, float, float, float],
        colour: Colour,
        edge: Colour,
        *,
        plain: bool = False,
        faded: float = 0.0,
    ) -> None:
        """``place``: x, y (m), yaw and angle of the front wheels (rad)."""
        x, y, yaw, steer = place

        def shown(paint: Colour) -> Colour:
            return mixed(paint, palette.ROAD, faded) if faded else paint

        turned, middle = self._stand(x, y, yaw)

        def outlines(parts: list[np.ndarray]) -> list[np.ndarray]:
            return [part @ turned + middle for part in parts]

        body = outlines(shell.body)
        if not faded:
            dim(picture, [part + _SHADOW * (self._scale, -self._scale) for part in body], 0.5)
        wheels = outlines(shell.under)
        cos, sin = math.cos(steer), math.sin(steer)
        turn = np.array(((cos, sin), (-sin, cos)))
        wheels += outlines([(wheel - hub) @ turn + hub for wheel, hub in shell.steered])
        for wheel in wheels:
            fill(picture, [wheel], shown(palette.TYRE))
        stroke(picture, wheels, shown(palette.LINE_STRONG), self._unit)
        fill(picture, body, shown(colour))
        if not plain:
            fill(picture, outlines(shell.dark), shown(palette.TYRE))
            glass = outlines(shell.glass)
            fill(picture, glass, shown(palette.GLASS))
            stroke(picture, glass, shown(palette.TYRE), self._unit)
        stroke(picture, body, shown(edge), (3 if edge == palette.ACCENT else 1.6) * self._unit)

    def _tail(self, picture: np.ndarray, actor: Actor, frame: int) -> None:
        """The way of the last moments in the colours of speed, thinner and paler with age."""
        drive = actor.way
        if drive.gone[frame]:
            return
        fps = self._take.form.fps
        first = max(0, frame - round(TAIL_S * fps))
        pieces = actor.steps.piece[drive.row][first : frame + 1]
        first += int(np.flatnonzero(pieces != pieces[-1])[-1]) + 1 if (pieces != pieces[-1]).any() else 0
        if frame - first < 2:
            return
        rows = slice(first, frame + 1)
        points = np.column_stack((drive.x[rows], drive.y[rows]))
        way = np.gradient(points, axis=0)
        length = np.hypot(*way.T)
        if length.sum() < 0.05:
            return
        across = np.column_stack((-way[:, 1], way[:, 0])) / np.maximum(length, 1e-6)[:, None]
        age = np.arange(len(points) - 1, -1, -1) / (TAIL_S * fps)
        wide = (_TAIL_HALF_M * (1.0 - age))[:, None]
        left, right = self.place(points + across * wide), self.place(points - across * wide)
        # Each piece stays where it is on the road, from frame to frame.
        starts = [0, *range(_TAIL_STEP - first % _TAIL_STEP, len(points) - 1, _TAIL_STEP)]
        for start, end in pairwise((*starts, len(points) - 1)):
            part = slice(start, end + 1)
            speed = float(drive.speed[rows][part].mean())
            colour = mixed(palette.SPEEDS[palette.speed_class(speed)], palette.ROAD, 0.15 + 0.75 * float(age[start]))
            fill(picture, [np.concatenate((left[part], right[part][::-1]))], colour)

    def _ring(self, picture: np.ndarray, x: float, y: float, actor: Actor, frame: int) -> None:
        """A ring around a car that stands after a reset; it closes as the time runs out."""
        drive, steps = actor.way, actor.steps
        px, py = self.place(np.array((x, y))).tolist()
        radius = _RING_M * self._scale
        disc(picture, px, py, radius, mixed(palette.ACCENT, palette.ROAD, 0.65), max(1, round(2 * self._unit)))
        row = int(drive.row[frame])
        begin = int(np.searchsorted(steps.piece, steps.piece[row]))
        whole = max(float(steps.wait[begin]), 0.01)
        share = min(max(1.0 - float(drive.wait[frame]) / whole, 0.0), 1.0)
        angle = np.radians(np.linspace(-90.0, -90.0 + 360.0 * share, 2 + round(60 * share)))
        arc = np.column_stack((px + radius * np.cos(angle), py + radius * np.sin(angle)))
        stroke(picture, [arc], palette.ACCENT, 4 * self._unit, closed=False)
        if begin and math.dist((x, y), (steps.x[begin - 1], steps.y[begin - 1])) > _RING_M:  # where it happened
            fx, fy = self.place(np.array((steps.x[begin - 1], steps.y[begin - 1]))).tolist()
            reach = 13 * self._unit
            cross = [np.array([(fx - reach, fy - s * reach), (fx + reach, fy + s * reach)]) for s in (-1, 1)]
            stroke(picture, cross, palette.ACCENT, 3 * self._unit, closed=False)

    def _tags(self, picture: np.ndarray, actor: Actor, frame: int) -> None:
        """The name of a car among several, and the fault for which it stands."""
        drive = actor.way
        x, y = float(drive.x[frame]), float(drive.y[frame])
        if not self._seen(x, y, 0.0):
            return
        px, py = self.place(np.array((x, y))).tolist()
        high = (_RING_M if drive.standing[frame] else 0.2) * self._scale
        texts: list[tuple[str, Colour | None, Colour]] = []
        if self._named:
            texts.append((actor.car.name, actor.colour, palette.TEXT))
        if drive.standing[frame]:
            texts.append((fault_words(self._take.words, drive, frame), None, palette.ACCENT))
        for text, swatch, colour in texts:
            sticker = tag(text, swatch, colour, self._unit)
            high += 6 * self._unit + sticker.cover.shape[0]
            left = min(max(px - sticker.cover.shape[1] / 2, 8), self._size[0] - sticker.cover.shape[1] - 8)
            sticker.put(picture, round(left), round(max(py - high, 8)), 0.86 * (1 - _GONE * bool(drive.gone[frame])))


def fault_words(words: Words, drive: Motion, frame: int) -> str:
    """Why a car stands, and for how long."""
    why = {
        CRASHED: words.crashed,
        OFF_TRACK: words.off_track,
        IMMOBILIZED: words.stood_still,
        REVERSED: words.reversed,
    }.get(str(drive.fault[frame]), "")
    return f"{why} {drive.wait[frame]:.1f} s".strip()


@lru_cache(maxsize=256)
def tag(text: str, swatch: Colour | None, colour: Colour, unit: float) -> Sticker:
    size = 14 * unit
    cover = mask(shortened(text, size, True, round(220 * unit)), size, True)
    room = round(16 * unit) if swatch is not None else 0
    pad = round(9 * unit)
    sticker = Sticker.card(cover.shape[1] + room + 2 * pad, cover.shape[0] + round(6 * unit), 6 * unit, palette.SUNKEN)
    share = cover[:, :, None].astype(np.float32) / 255.0
    top, left = round(3 * unit), pad + room
    under = sticker.pixels[top : top + cover.shape[0], left : left + cover.shape[1]]
    under[:] = np.rint(under * (1 - share) + np.array(colour, np.float32) * share)
    if swatch is not None:
        disc(sticker.pixels, pad + 5 * unit, sticker.pixels.shape[0] / 2, 5 * unit, swatch)
    return sticker
