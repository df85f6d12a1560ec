"""The main picture in perspective: the road, its surroundings and the cars, from a camera of :mod:`.lens`."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from . import bodies, palette
from .bodies import Mesh
from .brush import dim, fill, fixed, stroke
from .ground import Ground, GroundPaint, Patch
from .lens import NEAR_M, FrameCamera, before_camera
from .palette import Colour, bgr
from .timeline import Actor, FrameTimeline
from .view import fault_words, tag

# The colours of the viewer's dark scene (static/viewer/scene.js).
_PAINT = GroundPaint(
    verge=bgr("#453f38"), road=bgr("#3b4048"), line=bgr("#cfd5dc"), dash=bgr("#b98a2e"), kerb_red=bgr("#b01f33"),
    kerb_white=bgr("#f0f2f5"), dark=bgr("#14161a"), light=bgr("#eef1f5"), border_m=0.0381, verge_m=0.3,
)  # fmt: skip
_GRASS, _MOWN, _FOG = bgr("#3a5744"), bgr("#405f49"), bgr("#3c4058")
_SKY = (  # radians above the horizon
    (-0.06, "#4a4660"), (0.0, "#c9805f"), (0.06, "#8a5a72"), (0.2, "#3d3f6e"), (0.5, "#16244a"), (1.2, "#070c1c")
)  # fmt: skip
_HILLS = ((0.062, 0.0, bgr("#38415f")), (0.034, 1.7, bgr("#27344a")))  # height (rad), phase, colour
_LIGHT = np.array((-0.45, -0.5, 0.74)) / np.linalg.norm((-0.45, -0.5, 0.74))
_AIR, _SUN = 0.62, 0.5
_FOG_FROM_M, _FOG_M = 9.0, 61.0
_REACH_M = 22.0
_STRIPE_M = 1.5
_SHADOW_M = (0.17, 0.105)
_TREES = 60
_ROUND_M = 1.0  # around the middle of every thing
_CLOSE_M = 0.72  # nothing stands between the camera and its car
_SWATCHES = {
    bodies.DARK: bgr("#1b1e24"), bodies.GLASS: bgr("#22303d"), bodies.RED: bgr("#ff2a2a"), bodies.WHITE: bgr("#f4f6f8"),
    bodies.TYRE: bgr("#1b1e22"), bodies.RIM: bgr("#c9d0d8"), bodies.WOOD: bgr("#5b4432"), bodies.LEAF: bgr("#2b5340"),
}  # fmt: skip


class _Thing(NamedTuple):
    """Something to paint: its mesh, the colour of its body, its place, how far away it is, and how much of it the
    ground's colour hides."""

    mesh: Mesh
    colour: Colour
    x: float
    y: float
    away: float
    faded: float = 0.0


class PerspectiveView:
    """Paints the picture below the bar. ``height``: of that part, px."""

    def __init__(self, take: FrameTimeline, width: int, height: int) -> None:
        assert take.lens is not None, "a camera in perspective"
        self._take, self._lens, self._size = take, take.lens, (width, height)
        self._unit = take.form.height / 720.0
        track = take.scene.track
        self._ground = Ground(track, _REACH_M, _PAINT)
        self._named = len(take.actors) > 1
        self._still = [
            *(_still(bodies.box(), palette.BOX, x, y, yaw) for x, y, yaw in take.boxes),
            *(_still(bodies.tree(), palette.BOX, x, y, turn, size) for x, y, turn, size in _trees(take)),
        ]
        x, y, yaw = track.point_at(track.finish_m)
        self._still.append(
            _still(bodies.arch(round(100 * track.width_at(track.finish_m)) + 50), palette.BOX, x, y, yaw)
        )
        self._driven = {id(actor): _driven(actor) for actor in take.actors if actor.drive is not None}

    def paint(self, picture: np.ndarray, frame: int) -> None:
        """Paint frame number ``frame`` onto the lower rows of ``picture``."""
        picture = picture[-self._size[1] :]
        sight = self._sight = FrameCamera(self._lens, frame, self._size)
        self._backdrop(picture)
        ahead = sight.eye[:2] + 0.6 * _REACH_M * sight.axes[:2, 2]
        self._stripes(picture)
        for patch in self._ground.around(*ahead):
            self._patch(picture, patch)
        self._haze(picture)
        things = [*self._bots(frame), *self._cars(picture, frame)]
        for still in self._still:
            away = math.dist((still.x, still.y), sight.eye[:2])
            things.append(still._replace(away=away))
        for thing in sorted(things, key=lambda thing: -thing.away):
            self._paint(picture, thing)
        seen = [actor for actor in self._take.actors if actor.drive is not None]
        seen.sort(key=lambda actor: -math.dist((actor.way.x[frame], actor.way.y[frame]), sight.eye[:2]))
        for actor in seen:
            self._tags(picture, actor, frame)

    def _backdrop(self, picture: np.ndarray) -> None:
        sight, (width, height) = self._sight, self._size
        rows = np.arange(height)
        lift = np.arctan((sight.centre[1] - rows - 0.5) / sight.focal) - sight.pitch
        stops, colours = zip(*((at, bgr(colour)) for at, colour in _SKY), strict=True)
        sky = np.column_stack([np.interp(lift, stops, [colour[k] for colour in colours]) for k in range(3)])
        below = rows + 0.5 > sight.horizon
        sky[below] = _GRASS
        column = np.rint(sky).astype(np.uint8)[:, None]
        cv2.resize(column, (width, height), dst=picture, interpolation=cv2.INTER_NEAREST)  # faster than numpy
        across = np.linspace(0.0, width, 65)
        turn = sight.heading - np.arctan((across - sight.centre[0]) / sight.focal)
        for high, phase, colour in _HILLS:
            shape = np.sin(3 * turn + phase) + 0.6 * np.sin(7 * turn + 2 * phase) + 0.35 * np.sin(17 * turn + phase)
            tops = sight.horizon - sight.focal * high * (0.6 + 0.2 * shape)
            outline = np.column_stack((across, tops))
            foot = [(width, sight.horizon + 2.0), (0.0, sight.horizon + 2.0)]
            fill(picture, [np.concatenate((outline, foot))], colour)

    def _stripes(self, picture: np.ndarray) -> None:
        """Mown stripes, which show motion beside the road."""
        eye = self._sight.eye
        first = math.floor((eye[0] - _REACH_M) / (2 * _STRIPE_M))
        stripes = []
        for number in range(first, first + math.ceil(_REACH_M / _STRIPE_M) + 1):
            x, low, high = number * 2 * _STRIPE_M, eye[1] - _REACH_M, eye[1] + _REACH_M
            stripes.append(np.array([(x, low), (x + _STRIPE_M, low), (x + _STRIPE_M, high), (x, high)]))
        self._patch(picture, Patch.of(stripes, _MOWN))

    def _patch(self, picture: np.ndarray, patch: Patch) -> None:
        sight = self._sight
        seen = sight.see(patch.corners)
        inside = seen[:, 2] >= NEAR_M
        if not inside.any():
            return
        starts = np.array([part.start for part in patch.parts])
        whole = np.logical_and.reduceat(inside, starts)
        some = np.logical_or.reduceat(inside, starts)
        points = fixed(sight.place(np.maximum(seen, (-np.inf, -np.inf, NEAR_M))))
        outlines = []
        for part, is_whole, is_some in zip(patch.parts, whole.tolist(), some.tolist(), strict=True):
            if is_whole:
                outlines.append(points[part])
            elif is_some:
                outlines.append(fixed(sight.place(before_camera(seen[part]))))
        cv2.fillPoly(picture, outlines, patch.colour, cv2.LINE_AA, 4)

    def _haze(self, picture: np.ndarray) -> None:
        """Far ground fades into the air."""
        first = max(0, math.ceil(self._sight.horizon - 0.5))
        rows = np.arange(first, self._size[1])
        share = _fog(self._sight.depth_of_rows(rows))
        rows = rows[share > 0.004]
        if len(rows):
            part = picture[rows[0] : rows[-1] + 1]
            share = share[: len(rows), None, None].astype(np.float32)
            part[:] = np.rint(part * (1.0 - share) + np.array(_FOG, np.float32) * share).astype(np.uint8)

    def _bots(self, frame: int) -> list[_Thing]:
        found = []
        for bot in self._take.bots:
            x, y, yaw = bot[frame].tolist()
            mesh = bodies.car("paddock", 0.0, 0.0).moved(x, y, yaw)
            found.append(_Thing(mesh, palette.BOT, x, y, math.dist((x, y), self._sight.eye[:2])))
        return found

    def _cars(self, picture: np.ndarray, frame: int) -> list[_Thing]:
        found = []
        for actor in self._take.actors:
            if actor.drive is None:
                continue
            drive = actor.way
            x, y, yaw, steer = (float(column[frame]) for column in (drive.x, drive.y, drive.yaw, drive.steer))
            away = math.dist((x, y), self._sight.eye[:2])
            if actor is not self._take.hero and away < _CLOSE_M and self._take.scene.camera != "trackside":
                continue
            mesh = bodies.car(actor.car.shell, steer, float(self._driven[id(actor)][frame])).moved(x, y, yaw)
            found.append(_Thing(mesh, actor.colour, x, y, away, 0.65 if drive.gone[frame] else 0.0))
            self._shadow(picture, x, y, yaw)
            if drive.standing[frame]:
                self._ring(picture, x, y)
        return found

    def _on_ground(self, points: np.ndarray) -> np.ndarray:
        """Points on the ground in px, without those behind the camera."""
        seen = before_camera(self._sight.see(points))
        return self._sight.place(seen) if len(seen) else np.empty((0, 2))

    def _shadow(self, picture: np.ndarray, x: float, y: float, yaw: float) -> None:
        angle = np.linspace(0.0, 2 * math.pi, 20, endpoint=False)
        along, across = (np.sign(one) * np.abs(one) ** 0.5 for one in (np.cos(angle), np.sin(angle)))
        along, across = along * _SHADOW_M[0], across * _SHADOW_M[1]
        cos, sin = math.cos(yaw), math.sin(yaw)
        points = np.column_stack((x + along * cos - across * sin + 0.012, y + along * sin + across * cos + 0.012))
        outline = self._on_ground(points)
        if len(outline) > 2:
            dim(picture, [outline], 0.55)

    def _ring(self, picture: np.ndarray, x: float, y: float) -> None:
        """A ring around a car that stands after a reset."""
        angle = np.linspace(0.0, 2 * math.pi, 48, endpoint=False)
        outline = self._on_ground(np.column_stack((x + 0.27 * np.cos(angle), y + 0.27 * np.sin(angle))))
        if len(outline) > 2:
            stroke(picture, [outline], palette.ACCENT, 3 * self._unit)

    def _paint(self, picture: np.ndarray, thing: _Thing) -> None:
        sight, mesh = self._sight, thing.mesh
        aside, _, ahead = (np.array((thing.x, thing.y, 0.0)) - sight.eye) @ sight.axes
        if ahead < -_ROUND_M or abs(aside) > ahead * self._size[0] / 2.0 / sight.focal + 2.0 * _ROUND_M:
            return
        seen = sight.see(mesh.corners)
        near = np.minimum.reduceat(seen[:, 2], mesh.starts)
        sizes = np.diff((*mesh.starts, len(mesh.corners)))
        middles = np.add.reduceat(mesh.corners, mesh.starts) / sizes[:, None]
        towards = sight.eye - middles
        facing = ((mesh.normals * towards).sum(axis=1) > 0.0) & (near > NEAR_M)
        if not facing.any():
            return
        points = sight.place(np.maximum(seen, (-np.inf, -np.inf, NEAR_M)))
        left, right = np.minimum.reduceat(points[:, 0], mesh.starts), np.maximum.reduceat(points[:, 0], mesh.starts)
        facing &= (right > 0) & (left < self._size[0])
        bright = _AIR + _SUN * np.maximum(mesh.normals @ _LIGHT, 0.0) + 0.08 * mesh.normals[:, 2]
        swatches = np.array([thing.colour, *(_SWATCHES[k] for k in range(1, len(_SWATCHES) + 1))], float)
        bright = np.where(mesh.paints == bodies.RED, 1.0, bright)
        colours = np.minimum(swatches[mesh.paints] * bright[:, None], 255.0)
        hidden = float(_fog(np.array((thing.away,)))[0])
        colours += (np.array(_FOG) - colours) * hidden
        colours += (np.array(_PAINT.road) - colours) * thing.faded
        faces = np.flatnonzero(facing)
        order = np.lexsort((-np.linalg.norm(towards[faces], axis=1), mesh.layers[faces]))
        corners, paints = fixed(points), np.rint(colours).tolist()
        for face in faces[order].tolist():
            start = mesh.starts[face]
            cv2.fillPoly(picture, [corners[start : start + sizes[face]]], paints[face], cv2.LINE_AA, 4)

    def _tags(self, picture: np.ndarray, actor: Actor, frame: int) -> None:
        """The name of a car among several, and the fault for which it stands."""
        drive = actor.way
        is_hero = actor is self._take.hero
        texts: list[tuple[str, Colour | None, Colour]] = []
        if self._named and not is_hero:
            texts.append((actor.car.name, actor.colour, palette.TEXT))
        if drive.standing[frame]:
            texts.append((fault_words(self._take.words, drive, frame), None, palette.ACCENT))
        at = np.array([(float(drive.x[frame]), float(drive.y[frame]), 0.24)])
        (seen,) = self._sight.see(at)
        if not texts or seen[2] < 0.3:
            return
        px, py = self._sight.place(seen[None])[0].tolist()
        if not 0.0 < px < self._size[0] or py < 0.0:
            return
        for text, swatch, colour in reversed(texts):
            sticker = tag(text, swatch, colour, self._unit)
            py -= 6 * self._unit + sticker.cover.shape[0]
            left = min(max(px - sticker.cover.shape[1] / 2, 8), self._size[0] - sticker.cover.shape[1] - 8)
            sticker.put(picture, round(left), round(max(py, 8)), 0.86 * (1 - 0.65 * bool(drive.gone[frame])))


def _still(mesh: Mesh, colour: Colour, x: float, y: float, yaw: float, size: float = 1.0) -> _Thing:
    return _Thing(mesh.moved(x, y, yaw, size=size), colour, x, y, 0.0)


def _fog(depth: np.ndarray) -> np.ndarray:
    return 0.92 * np.clip((depth - _FOG_FROM_M) / _FOG_M, 0.0, 1.0)


def _driven(actor: Actor) -> np.ndarray:
    """Metres driven until each frame, for the turning of wheels."""
    step = np.hypot(np.diff(actor.way.x, prepend=actor.way.x[0]), np.diff(actor.way.y, prepend=actor.way.y[0]))
    return np.cumsum(np.where(step > 0.3, 0.0, step))


def _trees(take: FrameTimeline) -> list[tuple[float, float, float, float]]:
    """x, y, heading and size of trees beside the road, the same for every video of a track."""
    track = take.scene.track
    numbers = np.random.default_rng(len(track))
    x_min, y_min, x_max, y_max = track.bounds
    found = []
    for _ in range(3 * _TREES):
        x, y = numbers.uniform(x_min - 9.0, x_max + 9.0), numbers.uniform(y_min - 9.0, y_max + 9.0)
        turn, size = numbers.uniform(0.0, 6.0), numbers.uniform(0.75, 1.5)
        near = track.project(x, y)
        if abs(near.offset) > track.width_at(near.distance) / 2 + 1.0 + 0.5 * size:
            found.append((float(x), float(y), float(turn), float(size)))
        if len(found) == _TREES:
            break
    return found
