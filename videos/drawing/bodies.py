"""Solid things of a video in perspective: cars in their shells, boxes, trees and the arch, as flat faces.

A body is made of both drawings of its shell, as static/viewer/scene-shells.js makes it: the side view gives the
heights, the view from above the widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from evaluation.appearance.looks import Shell
from evaluation.appearance.shells import GROUND
from paddock.simulator.solids import box as box_solid

from . import shapes
from .shapes import UNIT_M

BODY, DARK, GLASS, RED, WHITE, TYRE, RIM, WOOD, LEAF = range(9)  # what a face is painted with
_MIDDLE = 60.0  # of a side view, units
_STATIONS = 20
_WHEEL, _AXLE = 1.12, 14.0  # drawn wheels are a little smaller than the real ones; the greatest width of one
_STRIPES = ((-4.6, -3.0), (3.0, 4.6))
_OPEN = (Shell.FORMULA, Shell.KART, Shell.BUGGY, Shell.ROADSTER)  # a helmet is seen
_ROUND, _SPOKES = 14, 5


class Mesh(NamedTuple):
    """Flat faces in metres around the middle of a thing, z up. ``corners`` (n, 3); face k has those from ``starts[k]``
    on. ``normals`` (faces, 3); ``paints`` (faces,). ``layers`` (faces,): those of a higher one are painted later."""

    corners: np.ndarray
    starts: np.ndarray
    normals: np.ndarray
    paints: np.ndarray
    layers: np.ndarray

    def moved(self, x: float, y: float, yaw: float, z: float = 0.0, size: float = 1.0) -> Mesh:
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.array(((cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, 1.0)))
        return self._replace(corners=self.corners @ (turn * size) + (x, y, z), normals=self.normals @ turn)


class Faces:
    """Collects faces."""

    def __init__(self) -> None:
        self._outlines: list[np.ndarray] = []
        self._normals: list[np.ndarray] = []
        self._paints: list[int] = []
        self._layers: list[int] = []

    def add(self, outline: np.ndarray | Sequence, paint: int, outwards: Sequence[float], layer: int = 0) -> None:
        """A face, which looks to the side of ``outwards``."""
        outline = np.array(outline, float)
        normal = np.cross(outline - outline[0], np.roll(outline, -1, axis=0) - outline[0]).sum(axis=0)
        size = float(np.linalg.norm(normal))
        if size < 1e-9:
            return
        self._outlines.append(outline)
        self._normals.append(normal * (math.copysign(1.0, float(normal @ np.array(outwards))) / size))
        self._paints.append(paint)
        self._layers.append(layer)

    def block(self, low: Sequence[float], high: Sequence[float], paint: int) -> None:
        """An upright block between two corners."""
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            for side, at in ((-1.0, low[axis]), (1.0, high[axis])):
                outline = np.empty((4, 3))
                outline[:, axis] = at
                outline[:, one] = (low[one], high[one], high[one], low[one])
                outline[:, two] = (low[two], low[two], high[two], high[two])
                outwards = np.zeros(3)
                outwards[axis] = side
                self.add(outline, paint, outwards.tolist())

    def mesh(self) -> Mesh:
        sizes = [len(outline) for outline in self._outlines]
        starts = np.concatenate(([0], np.cumsum(sizes)[:-1]))
        corners = np.concatenate(self._outlines)
        return Mesh(corners, starts, np.array(self._normals), np.array(self._paints), np.array(self._layers))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0, *(len(mesh.corners) for mesh in meshes)])
    starts = [mesh.starts + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    rest = [np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in ("normals", "paints", "layers")]
    return Mesh(np.concatenate([mesh.corners for mesh in meshes]), np.concatenate(starts), *rest)


class _Section(NamedTuple):
    """A cut through a body: half its width, its ends in height, and (y, z) of its wall and lid from below to above."""

    x: float
    wide: float
    bottom: float
    top: float
    wall: np.ndarray
    lid: np.ndarray


def _span(outline: np.ndarray, x: float) -> tuple[float, float]:
    """The least and greatest y of an outline at x."""
    before = np.roll(outline, 1, axis=0)
    found: list[float] = []
    for (ax, ay), (bx, by) in zip(before.tolist(), outline.tolist(), strict=True):
        if min(ax, bx) - 1e-6 <= x <= max(ax, bx) + 1e-6:
            found += [ay, by] if abs(bx - ax) < 1e-6 else [ay + (x - ax) / (bx - ax) * (by - ay)]
    return (min(found), max(found)) if found else (0.0, 0.0)


def _sections(side: shapes.Side, above: shapes.Above) -> list[_Section]:
    profile, plan = side.body[0], above.body[0] / UNIT_M
    belt = max((float(part[:, 1].max()) for part in side.glass), default=None)
    first, last = float(profile[:, 0].min()), float(profile[:, 0].max())
    low_end, high_end = float(plan[:, 0].min()) + 0.4, float(plan[:, 0].max()) - 0.4
    places = sorted({*profile[:, 0].tolist(), *np.linspace(first, last, _STATIONS).tolist()})
    sections: list[_Section] = []
    for place in places:
        if sections and place < last and place - (sections[-1].x / UNIT_M + _MIDDLE) < 1.2:
            continue
        high, low = _span(profile, min(max(place, first + 0.01), last - 0.01))
        wide = max(_span(plan, min(max(place - _MIDDLE, low_end), high_end))[1], 0.4) * UNIT_M
        bottom, top = (GROUND - low) * UNIT_M, (GROUND - high) * UNIT_M
        shoulder = bottom + 0.7 * (top - bottom) if belt is None else (GROUND - belt) * UNIT_M
        shoulder = min(top - 0.1 * (top - bottom), shoulder)
        roof = wide * (1.0 - min(0.3, 0.1 + 4.0 * (top - max(shoulder, bottom))))
        waist = max(shoulder, bottom + 0.6 * (top - bottom) if belt is None else bottom)
        edge = (roof, top - 0.06 * wide)
        wall = np.array([(0.9 * wide, bottom), (wide, bottom + 0.4 * (waist - bottom)), (0.97 * wide, waist), edge])
        lid = np.array([edge, (0.7 * roof, top - 0.012 * wide), (0.0, top)])
        sections.append(_Section((place - _MIDDLE) * UNIT_M, wide, bottom, top, wall, lid))
    return sections


@cache
def body(shell: str) -> Mesh:
    """The body of a shell without its wheels; Paddock's for an unknown word."""
    side, above = shapes.side(shell), shapes.above(shell)
    sections, faces = _sections(side, above), Faces()
    for back, front in pairwise(sections):
        for name, outwards in (("wall", (0.0, 1.0, 0.2)), ("lid", (0.0, 0.0, 1.0))):
            rear, fore = getattr(back, name), getattr(front, name)
            for k in range(len(rear) - 1):
                corners = [(back.x, *rear[k]), (front.x, *fore[k]), (front.x, *fore[k + 1]), (back.x, *rear[k + 1])]
                faces.add(corners, BODY, outwards)
                faces.add([(x, -y, z) for x, y, z in corners], BODY, (outwards[0], -outwards[1], outwards[2]))
        if shell not in _OPEN and back.x > -0.14 and front.x < 0.14:
            for stripe in _STRIPES:
                left, right = (y * UNIT_M for y in stripe)
                ends = [
                    (one.x, y, one.top + 0.001)
                    for one, y in ((back, left), (back, right), (front, right), (front, left))
                ]
                faces.add(ends, WHITE, (0.0, 0.0, 1.0), layer=1)
    _ends(faces, sections)
    _windows(faces, sections, side, above)
    _dark_parts(faces, sections, side, above)
    if shell in _OPEN:
        _helmet(faces, sections, above)
    return faces.mesh()


def _ends(faces: Faces, sections: Sequence[_Section]) -> None:
    """Both ends, closed, with their lights."""
    for from_end, way, light in ((sections, -1.0, RED), (sections[::-1], 1.0, WHITE)):
        end = from_end[0]
        half = np.concatenate((end.wall, end.lid[1:]))
        outline = np.concatenate((half, half[-2::-1] * (-1.0, 1.0)))
        faces.add(np.column_stack((np.full(len(outline), end.x), outline)), BODY, (way, 0.0, 0.0))
        end = next(section for section in from_end if section.top - section.bottom > 0.018)
        if end.wide < 0.02:
            continue
        middle, high = end.bottom + 0.62 * (end.top - end.bottom), 0.16 * (end.top - end.bottom)
        x = end.x + 0.002 * way
        for sign in (-1.0, 1.0):
            low, far = sign * 0.92 * end.wide, sign * 0.44 * end.wide
            lamp = [(x, low, middle - high), (x, far, middle - high), (x, far, middle + high), (x, low, middle + high)]
            faces.add(lamp, light, (way, 0.0, 0.0), layer=2)


def _windows(faces: Faces, sections: Sequence[_Section], side: shapes.Side, above: shapes.Above) -> None:
    places = np.array([section.x for section in sections])

    def at(name: str, x: np.ndarray) -> np.ndarray:
        return np.interp(x, places, [getattr(section, name) for section in sections])

    for part in side.glass:
        x, z = (part[:, 0] - _MIDDLE) * UNIT_M, (GROUND - part[:, 1]) * UNIT_M
        nearest = [sections[int(np.abs(places - one).argmin())] for one in x.tolist()]
        y = np.array([np.interp(up, one.wall[:, 1], one.wall[:, 0]) for one, up in zip(nearest, z, strict=True)])
        for sign in (-1.0, 1.0):
            faces.add(np.column_stack((x, sign * (y + 0.001), z)), GLASS, (0.0, sign, 0.0), layer=2)
    for part, paint in [(part, GLASS) for part in above.glass] + [(part, DARK) for part in above.dark]:
        x, y = part.T
        top, wide = at("top", x), at("wide", x)
        lowered = top - 0.06 * wide * np.clip(np.abs(y) / np.maximum(wide, 1e-6), 0.0, 1.0) ** 2 + 0.0012
        faces.add(np.column_stack((x, y, lowered)), paint, (0.0, 0.0, 1.0), layer=2)


def _dark_parts(faces: Faces, sections: Sequence[_Section], side: shapes.Side, above: shapes.Above) -> None:
    """Wings, sills, masts and cages: the dark parts of the side view, as wide as the view from above has them there."""
    wings = [part for part in above.under if np.ptp(part[:, 0]) < _AXLE * UNIT_M]
    flat = [part / UNIT_M for part in (*above.dark, *wings)]
    for outline in side.dark:
        (x0, high), (x1, _) = outline.min(axis=0), outline.max(axis=0)
        found = [part for part in flat if part[:, 0].min() < x1 - _MIDDLE and part[:, 0].max() > x0 - _MIDDLE]
        if high > 38 and x1 - x0 > 40:  # a sill
            within = [s.wide / UNIT_M for s in sections if x0 - 4 <= s.x / UNIT_M + _MIDDLE <= x1 + 4]
            ranges = [(-max(within), max(within))]
        elif found and high < 38:
            ranges = [(float(part[:, 1].min()), float(part[:, 1].max())) for part in found]
        else:
            ranges = [(-25.0, 25.0)] if high > 40 else [(-3.0, 3.0)]
        x, z = (outline[:, 0] - _MIDDLE) * UNIT_M, (GROUND - outline[:, 1]) * UNIT_M
        middle = np.array((x.mean(), z.mean()))
        for near, far in ((right * UNIT_M, left * UNIT_M) for right, left in ranges):
            for y, way in ((near, -1.0), (far, 1.0)):
                faces.add(np.column_stack((x, np.full(len(x), y), z)), DARK, (0.0, way, 0.0))
            for k in range(len(x)):
                ends = [(x[k - 1], near, z[k - 1]), (x[k], near, z[k]), (x[k], far, z[k]), (x[k - 1], far, z[k - 1])]
                out = np.array(((x[k - 1] + x[k]) / 2, (z[k - 1] + z[k]) / 2)) - middle
                faces.add(ends, DARK, (float(out[0]), 0.0, float(out[1])))


def _helmet(faces: Faces, sections: Sequence[_Section], above: shapes.Above) -> None:
    part = (above.dark or above.glass)[0]
    x = float(part[:, 0].min() + part[:, 0].max()) / 2
    top = min(sections, key=lambda section: abs(section.x - x)).top
    ring = np.linspace(0.0, 2 * math.pi, 9)
    levels = [(0.02 * math.cos(lift), top + 0.012 + 0.02 * math.sin(lift)) for lift in (-0.6, 0.1, 0.7, 1.2)]
    for (low_r, low_z), (high_r, high_z) in pairwise(levels):
        for a, b in pairwise(ring.tolist()):
            corners = [
                (x + r * math.cos(angle), r * math.sin(angle), z)
                for r, angle, z in ((low_r, a, low_z), (low_r, b, low_z), (high_r, b, high_z), (high_r, a, high_z))
            ]
            faces.add(corners, WHITE, (math.cos((a + b) / 2), math.sin((a + b) / 2), 0.5))
    cap_r, cap_z = levels[-1]
    faces.add([(x + cap_r * math.cos(a), cap_r * math.sin(a), cap_z) for a in ring[:-1]], WHITE, (0.0, 0.0, 1.0))


class Wheel(NamedTuple):
    x: float
    y: float
    radius: float
    width: float
    steered: bool


@cache
def wheels(shell: str) -> tuple[Wheel, ...]:
    """The wheels of a shell: middle and size, m."""
    side, above = shapes.side(shell), shapes.above(shell)
    axles = [(x - _MIDDLE) * UNIT_M for x, _, _ in side.wheels]
    radius = side.wheels[0][2] * UNIT_M * _WHEEL
    found = []
    for part, steered in [(part, False) for part in above.under] + [(part, True) for part, _ in above.steered]:
        x, y = ((part.min(axis=0) + part.max(axis=0)) / 2).tolist()
        if np.ptp(part[:, 0]) < _AXLE * UNIT_M:
            continue  # a wing
        wide = min(_AXLE * UNIT_M, float(np.ptp(part[:, 1])))
        near = min(axles, key=lambda axle: abs(axle - x))
        for middle in (
            (y,)
            if np.ptp(part[:, 1]) <= 2 * _AXLE * UNIT_M
            else (float(part[:, 1].min()) + wide / 2, float(part[:, 1].max()) - wide / 2)
        ):
            found.append(Wheel(near if abs(near - x) < 12 * UNIT_M else x, middle, radius, wide, steered))
    return tuple(found)


@cache
def _wheel(radius: float, width: float, side: float) -> tuple[Mesh, np.ndarray]:
    """A wheel around its middle with its rim to one side (1: left), and which of its corners are those of spokes."""
    faces = Faces()
    angles = np.linspace(0.0, 2 * math.pi, _ROUND + 1)

    def ring(r: float, y: float) -> np.ndarray:
        return np.column_stack((r * np.cos(angles[:-1]), np.full(_ROUND, y), r * np.sin(angles[:-1])))

    for k in range(_ROUND):
        a, b = angles[k], angles[k + 1]
        corners = [
            (radius * math.cos(t), y, radius * math.sin(t))
            for t, y in ((a, -width / 2), (b, -width / 2), (b, width / 2), (a, width / 2))
        ]
        faces.add(corners, TYRE, (math.cos((a + b) / 2), 0.0, math.sin((a + b) / 2)))
    y, out = side * width / 2, (0.0, side, 0.0)
    faces.add(ring(radius, -y), TYRE, (0.0, -side, 0.0))
    faces.add(ring(radius, y), TYRE, out)
    faces.add(ring(0.66 * radius, y + 0.0005 * side), RIM, out, layer=2)
    faces.add(ring(0.58 * radius, y + 0.0006 * side), TYRE, out, layer=2)
    for k in range(_SPOKES):
        a = 2 * math.pi * k / _SPOKES
        along, across = np.array((math.cos(a), math.sin(a))), np.array((-math.sin(a), math.cos(a))) * 0.09 * radius
        flat = [across, 0.62 * radius * along + across, 0.62 * radius * along - across, -across]
        faces.add([(x, y + 0.0008 * side, z) for x, z in flat], RIM, out, layer=2)
    mesh = faces.mesh()
    return mesh, np.arange(len(mesh.corners)) >= mesh.starts[-_SPOKES]


def car(shell: str, steer: float, driven_m: float) -> Mesh:
    """A car with its wheels; ``steer``: of the front wheels (rad); ``driven_m``: metres driven, which turn them."""
    parts = [body(shell)]
    for wheel in wheels(shell):
        mesh, spokes = _wheel(wheel.radius, wheel.width, math.copysign(1.0, wheel.y))
        corners = mesh.corners.copy()
        angle = -driven_m / wheel.radius
        cos, sin = math.cos(angle), math.sin(angle)
        x, z = corners[spokes, 0].copy(), corners[spokes, 2].copy()
        corners[spokes, 0], corners[spokes, 2] = x * cos - z * sin, x * sin + z * cos
        turned = mesh._replace(corners=corners)
        parts.append(turned.moved(wheel.x, wheel.y, steer if wheel.steered else 0.0, wheel.radius))
    return joined(parts)


@cache
def box() -> Mesh:
    """A box of cardboard with its tape."""
    solid, faces = box_solid(0.0, 0.0, 0.0), Faces()
    long, wide, high = solid.half_length, solid.half_width, solid.height
    faces.block((-long, -wide, 0.0), (long, wide, high), BODY)
    top = high + 0.001
    faces.add([(-long, -0.022, top), (long, -0.022, top), (long, 0.022, top), (-long, 0.022, top)], WHITE, (0, 0, 1), 2)
    for way in (-1.0, 1.0):
        x = way * (long + 0.001)
        faces.add(
            [(x, -0.022, 0.6 * high), (x, 0.022, 0.6 * high), (x, 0.022, high), (x, -0.022, high)],
            WHITE,
            (way, 0, 0),
            2,
        )
    return faces.mesh()


@cache
def tree() -> Mesh:
    """A fir of about 1.7 m."""
    faces = Faces()
    faces.block((-0.05, -0.05, 0.0), (0.05, 0.05, 0.4), WOOD)
    for radius, low, high in ((0.6, 0.32, 1.05), (0.47, 0.72, 1.45), (0.31, 1.1, 1.85)):
        ring = np.linspace(0.0, 2 * math.pi, 8)
        for a, b in pairwise(ring.tolist()):
            foot = [(radius * math.cos(t), radius * math.sin(t), low) for t in (a, b)]
            faces.add([*foot, (0.0, 0.0, high)], LEAF, (math.cos((a + b) / 2), math.sin((a + b) / 2), 0.6))
    return faces.mesh()


@cache
def arch(width: float) -> Mesh:
    """The arch over the finish line, across the y axis; ``width`` in cm between its posts."""
    half, faces = width / 200.0, Faces()
    for y in (-half, half):
        faces.block((-0.035, y - 0.035, 0.0), (0.035, y + 0.035, 0.92), DARK)
        faces.block((-0.1, y - 0.1, 0.0), (0.1, y + 0.1, 0.04), RED)
    faces.block((-0.03, -half, 0.76), (0.03, half, 0.93), DARK)
    for way in (-1.0, 1.0):
        x = way * 0.031
        for row in range(2):
            for column in range(12):
                if (row + column) % 2:
                    continue
                y, z = -half + column * half / 6, 0.76 + 0.085 * row
                side = [(x, y, z), (x, y + half / 6, z), (x, y + half / 6, z + 0.085), (x, y, z + 0.085)]
                faces.add(side, WHITE, (way, 0.0, 0.0), layer=2)
    return faces.mesh()
