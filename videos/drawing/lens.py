"""The cameras of a video in perspective: where each of them is in every frame, and how a frame's camera sees points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from paddock.geometry.track import TrackGeometry

from .motion import Motion, Steps, drive_of

# As static/viewer/scene-cameras.js has them.
PERSPECTIVE = ("chase", "onboard", "trackside")
NEAR_M = 0.04
_LAGS_MS = (0.0, 90.0, 180.0, 270.0, 360.0)  # the chase camera looks where the car went in the last third of a second
_RESET_M = 2.2
_SPEED_S = 0.3
_POST_M = 5.5  # between two cameras beside the road


@dataclass(frozen=True)
class Lens:
    """A camera without roll in every frame: ``eye`` and ``aim`` (frames, 3) in metres, z up, and the vertical field of
    view ``fov`` (rad)."""

    eye: np.ndarray
    aim: np.ndarray
    fov: np.ndarray


class FrameCamera:
    """The camera of one frame. Points it sees are (n, 3): metres to the right, down and ahead."""

    def __init__(self, lens: Lens, frame: int, size: tuple[int, int]) -> None:
        self.eye = lens.eye[frame]
        ahead = lens.aim[frame] - self.eye
        ahead /= np.linalg.norm(ahead)
        right = np.array((ahead[1], -ahead[0], 0.0)) / math.hypot(ahead[0], ahead[1])
        self.axes = np.column_stack((right, np.cross(ahead, right), ahead))
        self.focal = size[1] / 2.0 / math.tan(float(lens.fov[frame]) / 2.0)
        self.centre = np.array(size) / 2.0
        pitch = math.asin(float(-ahead[2]))
        self.horizon = float(self.centre[1]) - self.focal * math.tan(pitch)
        self.pitch, self.heading = pitch, math.atan2(ahead[1], ahead[0])

    def see(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) in metres; (n, 2) lie on the ground."""
        if points.shape[1] == 2:
            return (points - self.eye[:2]) @ self.axes[:2] - self.eye[2] * self.axes[2]
        return (points - self.eye) @ self.axes

    def place(self, seen: np.ndarray) -> np.ndarray:
        """Seen points before the camera, in px."""
        return seen[:, :2] * (self.focal / seen[:, 2:]) + self.centre

    def depth_of_rows(self, rows: np.ndarray) -> np.ndarray:
        """The distance of the ground in rows of pixels below the horizon."""
        down = (rows + 0.5 - self.centre[1]) / self.focal
        fall = math.sin(self.pitch) + down * math.cos(self.pitch)
        return self.eye[2] / np.maximum(fall, 1e-6)


def before_camera(seen: np.ndarray) -> np.ndarray:
    """The part of an outline before the near plane (Sutherland and Hodgman); for a filled area, whose new edges all lie
    on the plane."""
    inside = seen[:, 2] >= NEAR_M
    if inside.all():
        return seen
    after, after_inside = np.roll(seen, -1, axis=0), np.roll(inside, -1)
    share = (NEAR_M - seen[:, 2:]) / np.where(inside != after_inside, after[:, 2] - seen[:, 2], 1.0)[:, None]
    crossings = seen + share * (after - seen)
    both = np.stack((seen, crossings), axis=1).reshape(-1, 3)
    return both[np.stack((inside, inside != after_inside), axis=1).reshape(-1)]


def lens_of(camera: str, steps: Steps, times: np.ndarray, fps: float, track: TrackGeometry) -> Lens:
    """The way of a camera of :data:`PERSPECTIVE`."""
    drive = drive_of(steps, times)
    if camera == "trackside":
        return _trackside(drive, track)
    if camera == "onboard":
        eye, aim = _ahead(drive, drive.yaw, 0.04, 0.15), _ahead(drive, drive.yaw, 1.4, -0.08)
        return Lens(eye, aim, np.full(len(times), math.radians(70.0)))
    heading = _heading(drive, steps, times)
    speed = gaussian_filter1d(drive.speed, _SPEED_S * fps, mode="nearest")
    return Lens(_ahead(drive, heading, -0.86, 0.4), _ahead(drive, heading, 0.75, 0.06), np.radians(52.0 + 2.2 * speed))


def _ahead(drive: Motion, heading: np.ndarray, metres: float, height: float) -> np.ndarray:
    return np.column_stack(
        (drive.x + metres * np.cos(heading), drive.y + metres * np.sin(heading), np.full(len(heading), height))
    )


def _heading(drive: Motion, steps: Steps, times: np.ndarray) -> np.ndarray:
    """The mean of the car's latest headings, not over a reset."""
    total, count = np.zeros(len(times)), np.zeros(len(times))
    near = np.ones(len(times), bool)
    for lag in _LAGS_MS:
        then = drive_of(steps, np.maximum(times - lag, 0.0))
        near &= np.hypot(then.x - drive.x, then.y - drive.y) <= _RESET_M
        turned = (then.yaw - drive.yaw + math.pi) % (2 * math.pi) - math.pi
        total, count = total + np.where(near, turned, 0.0), count + near
    return drive.yaw + total / np.maximum(count, 1)


def _trackside(drive: Motion, track: TrackGeometry) -> Lens:
    """From posts on the outer side of the road, the nearest to the car along the road."""
    number = max(4, round(track.length / _POST_M))
    posts = [_post(track, (k + 0.5) * track.length / number) for k in range(number)]
    metres = np.array([track.project(float(x), float(y)).distance for x, y in zip(drive.x, drive.y, strict=True)])
    chosen = np.minimum((metres % track.length) / track.length * number, number - 1).astype(int)
    eye = np.array(posts)[chosen]
    aim = np.column_stack((drive.x, drive.y, np.full(len(chosen), 0.06)))
    away = np.linalg.norm(eye - aim, axis=1)
    return Lens(eye, aim, np.clip(2.0 * np.arctan(0.85 / away), math.radians(16.0), math.radians(62.0)))


def _post(track: TrackGeometry, metres: float) -> tuple[float, float, float]:
    before, here, after = (track.point_at(metres + step)[:2] for step in (-0.5, 0.0, 0.5))
    bend = (here[0] - before[0]) * (after[1] - here[1]) - (here[1] - before[1]) * (after[0] - here[0])
    outer = -1.0 if bend > 0 else 1.0
    left, right = track.half_widths_at(metres)
    for side, away in ((outer, 0.75), (-outer, 0.75), (outer, 0.45), (-outer, 0.45)):
        x, y, _ = track.point_at(metres, side * ((left if side > 0 else right) + away))
        near = track.project(x, y)
        if abs(near.offset) > sum(track.half_widths_at(near.distance)) / 2 + 0.3:
            return x, y, 0.42
    return (*track.point_at(metres)[:2], 1.6)
