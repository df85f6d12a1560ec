"""The picture: ground bands by perspective warp, then walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tracks.geometry import TrackGeometry

from ..car import Pose
from .optics import FRONT_CAMERA, Optics
from .texture import Level, draw_ground
from .theme import OFFICIAL, Theme

NEAR_M = 0.02  # deepracer-simapp: near plane of the camera
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates


@dataclass(frozen=True)
class Scene:
    """All that a camera can see of a track: the ground's levels (finest first) and the hall."""

    theme: Theme
    levels: tuple[Level, ...]
    walls: tuple[float, float, float, float]  # xmin, ymin, xmax, ymax

    @classmethod
    def of(cls, track: TrackGeometry, theme: Theme = OFFICIAL) -> Scene:
        """Draw the scene of a track; takes some tens of milliseconds."""
        xmin, ymin, xmax, ymax = track.bounds
        margin = theme.field_margin
        return cls(theme, draw_ground(track, theme), (xmin - margin, ymin - margin, xmax + margin, ymax + margin))


@dataclass(frozen=True)
class _Band:
    """Rows drawn from one level, each as ``samples`` rows that are averaged: far rows cover much ground lengthwise."""

    first: int
    last: int  # one past
    level: int
    samples: int


class Camera:
    """Draws what a camera on the car sees."""

    def __init__(self, scene: Scene, optics: Optics = FRONT_CAMERA) -> None:
        self._scene = scene
        self._optics = optics
        self._horizon = math.floor(optics.horizon) + 1  # first row that shows ground
        ground = optics.ground_from_pixels()
        self._bands = []
        for band in _bands(optics, self._horizon):
            level = scene.levels[band.level]
            # Row r of the band's own picture is row first + (r + 0.5) / samples - 0.5 of the frame.
            rows = np.array([[1, 0, 0], [0, 1 / band.samples, band.first + 0.5 / band.samples - 0.5], [0, 0, 1]])
            self._bands.append((band, level, level.from_ground(), ground @ rows))

    def render(self, pose: Pose) -> np.ndarray:
        """The grey frame, uint8 (rows, columns), a fresh array."""
        optics, theme = self._optics, self._scene.theme
        frame = np.empty((optics.rows, optics.columns), np.uint8)
        frame[: self._horizon] = theme.sky
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        world = np.array([[cos, -sin, pose.x], [sin, cos, pose.y], [0.0, 0.0, 1.0]])
        for band, level, to_pixels, ground in self._bands:
            target = frame[band.first : band.last]
            drawn = target if band.samples == 1 else None
            drawn = cv2.warpPerspective(
                level.pixels,
                to_pixels @ world @ ground,
                (optics.columns, (band.last - band.first) * band.samples),
                dst=drawn,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=theme.field,
            )
            if band.samples > 1:
                cv2.resize(drawn, (optics.columns, band.last - band.first), dst=target, interpolation=cv2.INTER_AREA)
        self._draw_walls(frame, pose, cos, sin)
        return frame

    def _draw_walls(self, frame: np.ndarray, pose: Pose, cos: float, sin: float) -> None:
        optics = self._optics
        xmin, ymin, xmax, ymax = self._scene.walls
        corners = []
        for x, y in ((xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)):
            dx, dy = x - pose.x, y - pose.y
            corners.append((dx * cos + dy * sin - optics.x, dy * cos - dx * sin - optics.y))
        for index, start in enumerate(corners):
            points = _project_wall(start, corners[(index + 1) % 4], self._scene.theme.wall_height, optics)
            if points is not None:
                cv2.fillConvexPoly(frame, points, self._scene.theme.wall, cv2.LINE_AA, _SHIFT)


def _bands(optics: Optics, horizon: int) -> list[_Band]:
    far, middle = horizon + 10, horizon + 26
    return [_Band(horizon, far, 2, 8), _Band(far, middle, 1, 4), _Band(middle, optics.rows, 0, 1)]


def _project_wall(
    start: tuple[float, float], end: tuple[float, float], height: float, optics: Optics
) -> np.ndarray | None:
    """Corners in drawing coordinates of a wall between two ground points (forward, left of the camera), near-clipped.

    None where the wall lies behind the near plane. int32 (n, 2) with ``_SHIFT`` fractional bits.
    """
    cos, sin = math.cos(optics.pitch), math.sin(optics.pitch)
    corners = []
    for forward, left, up in (
        (*start, -optics.height),
        (*end, -optics.height),
        (*end, height - optics.height),
        (*start, height - optics.height),
    ):
        corners.append((forward * cos - up * sin, -left, -forward * sin - up * cos))  # depth, right, down
    inside = [corner[0] >= NEAR_M for corner in corners]
    if not any(inside):
        return None
    if not all(inside):
        corners = _clip(corners)
    focal, centre_u, centre_v = optics.focal, (optics.columns - 1) / 2, (optics.rows - 1) / 2
    scale = 1 << _SHIFT
    limit = 30_000  # OpenCV's coordinates are 16.16 inside
    points = [
        (
            min(max(round((centre_u + focal * right / depth) * scale), -limit * scale), limit * scale),
            min(max(round((centre_v + focal * down / depth) * scale), -limit * scale), limit * scale),
        )
        for depth, right, down in corners
    ]
    return np.array(points, np.int32)


def _clip(corners: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """The part of a polygon (depth, right, down) before the near plane (Sutherland and Hodgman)."""
    kept = []
    for index, corner in enumerate(corners):
        before = corners[index - 1]
        if (corner[0] >= NEAR_M) != (before[0] >= NEAR_M):
            share = (NEAR_M - before[0]) / (corner[0] - before[0])
            kept.append(tuple(a + share * (b - a) for a, b in zip(before, corner, strict=True)))
        if corner[0] >= NEAR_M:
            kept.append(corner)
    return kept
