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
_BLEED = 0.7  # pixels by which OpenCV's smooth polygons are too large on each side
_LIMIT = 30_000 << _SHIFT  # OpenCV counts pixels in 16 bits

_Corner = tuple[float, float, float]


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
    """Rows drawn from one level, each as ``samples`` rows that are averaged: far rows cover much ground lengthwise, and
    one sample of it would sparkle."""

    first: int
    last: int  # one past
    level: int
    samples: int


class Camera:
    """Draws what a camera on the car sees. The car does not roll or pitch: it has no suspension."""

    def __init__(self, scene: Scene, optics: Optics = FRONT_CAMERA) -> None:
        self._scene = scene
        self._optics = optics
        self._cos, self._sin = math.cos(optics.pitch), math.sin(optics.pitch)
        scale = 1 << _SHIFT
        self._scaled = (optics.focal * scale, (optics.columns - 1) / 2 * scale, (optics.rows - 1) / 2 * scale)
        self._bleed = _BLEED / optics.focal
        self._horizon = math.floor(optics.horizon) + 1  # first row that shows ground
        ground = optics.ground_from_pixels()
        self._bands = []
        for band in _bands(optics, self._horizon):
            level = scene.levels[band.level]
            # Row r of the band's own picture is row first + (r + 0.5) / samples - 0.5 of the frame.
            rows = np.array([[1, 0, 0], [0, 1 / band.samples, band.first + 0.5 / band.samples - 0.5], [0, 0, 1]])
            size = (optics.columns, (band.last - band.first) * band.samples)
            self._bands.append((band, size, level, ground @ rows))

    def render(self, pose: Pose) -> np.ndarray:
        """The grey frame, uint8 (rows, columns), a fresh array."""
        optics, theme = self._optics, self._scene.theme
        frame = np.empty((optics.rows, optics.columns), np.uint8)
        frame[: self._horizon] = theme.sky
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        for band, size, level, ground in self._bands:
            target = frame[band.first : band.last]
            drawn = cv2.warpPerspective(
                level.pixels,
                level.from_car(pose.x, pose.y, cos, sin) @ ground,
                size,
                dst=target if band.samples == 1 else None,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=theme.field,
            )
            if band.samples > 1:
                cv2.resize(drawn, (optics.columns, band.last - band.first), dst=target, interpolation=cv2.INTER_AREA)
        self._draw_walls(frame, pose, cos, sin)
        return frame

    def _draw_walls(self, frame: np.ndarray, pose: Pose, cos: float, sin: float) -> None:
        optics, theme = self._optics, self._scene.theme
        xmin, ymin, xmax, ymax = self._scene.walls
        feet = []
        for x, y in ((xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)):
            dx, dy = x - pose.x, y - pose.y
            feet.append((dx * cos + dy * sin - optics.x, dy * cos - dx * sin - optics.y))
        low, high = -optics.height, theme.wall_height - optics.height
        for index, (ax, ay) in enumerate(feet):
            bx, by = feet[index - 1]
            foot, top = -self._bleed, self._bleed
            corners = [
                self._seen(ax, ay, low, foot),
                self._seen(bx, by, low, foot),
                self._seen(bx, by, high, top),
                self._seen(ax, ay, high, top),
            ]
            self._fill(frame, corners, theme.wall)

    def _seen(self, forward: float, left: float, up: float, lower: float) -> _Corner:
        """A point relative to the camera as (depth along the axis, right, down), lowered by a share of the depth."""
        depth = forward * self._cos - up * self._sin
        return depth, -left, lower * depth - forward * self._sin - up * self._cos

    def _fill(self, frame: np.ndarray, corners: list[_Corner], grey: int) -> None:
        """Draw a convex polygon, near-clipped."""
        behind = sum(corner[0] < NEAR_M for corner in corners)
        if behind == len(corners):
            return
        if behind:
            corners = _clip(corners)
        focal, centre_u, centre_v = self._scaled
        points = []
        for depth, right, down in corners:
            scale = focal / depth
            column, row = centre_u + right * scale, centre_v + down * scale
            points.append((int(min(max(column, -_LIMIT), _LIMIT)), int(min(max(row, -_LIMIT), _LIMIT))))
        cv2.fillConvexPoly(frame, np.array(points, np.int32), grey, cv2.LINE_AA, _SHIFT)


def _bands(optics: Optics, horizon: int) -> list[_Band]:
    far, middle = horizon + 10, horizon + 26
    return [_Band(horizon, far, 2, 8), _Band(far, middle, 1, 4), _Band(middle, optics.rows, 0, 1)]


def _clip(corners: list[_Corner]) -> list[_Corner]:
    """The part of a polygon before the near plane (Sutherland and Hodgman)."""
    kept = []
    for index, corner in enumerate(corners):
        before = corners[index - 1]
        if (corner[0] >= NEAR_M) != (before[0] >= NEAR_M):
            share = (NEAR_M - before[0]) / (corner[0] - before[0])
            kept.append(
                (
                    NEAR_M,
                    before[1] + share * (corner[1] - before[1]),
                    before[2] + share * (corner[2] - before[2]),
                )
            )
        if corner[0] >= NEAR_M:
            kept.append(corner)
    return kept
