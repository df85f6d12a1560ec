"""The same scene as the warped camera's, built of triangles for Bullet's own renderer: an independent witness."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet as bullet

from paddock.geometry.track import TrackGeometry
from paddock.simulator.camera.optics import FRONT_CAMERA, Optics
from paddock.simulator.camera.theme import Theme
from paddock.simulator.car import Pose
from paddock.simulator.solids import Solid

OVERSAMPLING = 4  # the official camera draws 640x480 and shrinks it


class TinyScene:
    """A Bullet client that holds only what can be seen."""

    def __init__(self, track: TrackGeometry, theme: Theme, solids: Sequence[Solid] = ()) -> None:
        self.client = bullet.connect(bullet.DIRECT)
        self._theme = theme
        xmin, ymin, xmax, ymax = track.bounds
        margin = theme.field_margin
        box = (xmin - margin, ymin - margin, xmax + margin, ymax + margin)
        corners = [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
        # Layers a little below each other, the lines on the ground itself, so that none flickers through another.
        self._add([[(*corner, -0.0004) for corner in corners]], theme.field)
        count = len(track)
        distances = np.linspace(0.0, track.length, 6 * count, endpoint=False)
        widths = [track.half_widths_at(distance) for distance in distances]

        def strip(inner: list[float], outer: list[float], height: float, grey: int) -> None:
            rows = [
                (
                    (*track.point_at(distance, a)[:2], height),
                    (*track.point_at(distance, b)[:2], height),
                )
                for distance, a, b in zip(distances, inner, outer, strict=True)
            ]
            self._add([[p, q, rows[i - 1][1], rows[i - 1][0]] for i, (p, q) in enumerate(rows)], grey)

        strip([-right for _, right in widths], [left for left, _ in widths], -0.0002, theme.road)
        strip([left - theme.line_width for left, _ in widths], [left for left, _ in widths], 0.0, theme.line)
        strip([-right for _, right in widths], [theme.line_width - right for _, right in widths], 0.0, theme.line)
        dashes = round(track.length / theme.dash_pitch)
        half = theme.dash_width / 2
        quads = []
        for number in range(dashes):
            start = number * track.length / dashes
            end = start + theme.dash_length
            quads.append(
                [
                    (*track.point_at(d, s)[:2], 0.0)
                    for d, s in ((start, -half), (end, -half), (end, half), (start, half))
                ]
            )
        self._add(quads, theme.dash)
        for index, start in enumerate(corners):
            end = corners[(index + 1) % 4]
            self._add(
                [[(*start, 0.0), (*end, 0.0), (*end, theme.wall_height), (*start, theme.wall_height)]], theme.wall
            )

        for solid in solids:
            self._add_box(solid)

    def _add_box(self, solid: Solid) -> None:
        """An upright block with a grey for each face, and a lid."""
        pose = Pose(solid.x, solid.y, solid.yaw)
        ring = [
            pose.ahead(a * solid.half_length, b * solid.half_width) for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))
        ]
        for face, grey in enumerate(self._theme.box):
            start, end = ring[face], ring[(face + 1) % 4]
            self._add([[(*start, 0.0), (*end, 0.0), (*end, solid.height), (*start, solid.height)]], grey)
        self._add([[(*corner, solid.height) for corner in ring]], self._theme.box[0])

    def _add(self, quads: list[list[tuple[float, float, float]]], grey: int) -> None:
        for first in range(0, len(quads), 60):
            vertices, indices = [], []
            for quad in quads[first : first + 60]:
                base = len(vertices)
                vertices.extend(quad)
                for triangle in ((0, 1, 2), (0, 2, 3), (2, 1, 0), (3, 2, 0)):
                    indices.extend(base + corner for corner in triangle)
            shape = bullet.createVisualShape(
                bullet.GEOM_MESH,
                vertices=vertices,
                indices=indices,
                normals=[(0.0, 0.0, 1.0)] * len(vertices),
                rgbaColor=(grey / 255, grey / 255, grey / 255, 1.0),
                specularColor=(0, 0, 0),
                physicsClientId=self.client,
            )
            bullet.createMultiBody(0, -1, shape, physicsClientId=self.client)

    def render(self, pose: Pose, optics: Optics = FRONT_CAMERA) -> np.ndarray:
        """Grey uint8 (480, 640) as Bullet's TinyRenderer draws it."""
        eye_x, eye_y = pose.ahead(optics.x, optics.y)
        eye = np.array((eye_x, eye_y, optics.height))
        forward = np.array((math.cos(pose.yaw), math.sin(pose.yaw), 0.0))
        sight = forward * math.cos(optics.pitch) - np.array((0, 0, math.sin(optics.pitch)))
        up = forward * math.sin(optics.pitch) + np.array((0, 0, math.cos(optics.pitch)))
        columns, rows = optics.columns * OVERSAMPLING, optics.rows * OVERSAMPLING
        vertical = 2 * math.degrees(math.atan(math.tan(optics.horizontal_fov / 2) * rows / columns))
        _, _, rgba, _, _ = bullet.getCameraImage(
            columns,
            rows,
            bullet.computeViewMatrix(eye.tolist(), (eye + sight).tolist(), up.tolist()),
            bullet.computeProjectionMatrixFOV(vertical, columns / rows, 0.02, 50.0),
            shadow=0,
            lightAmbientCoeff=1.0,
            lightDiffuseCoeff=0.0,
            lightSpecularCoeff=0.0,
            renderer=bullet.ER_TINY_RENDERER,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self.client,
        )
        picture = np.reshape(rgba, (rows, columns, 4)).astype(np.uint8)
        grey = picture[:, :, 0].copy()
        # TinyRenderer leaves the background white; nothing in the scene is.
        grey[(picture[:, :, :3] == 255).all(axis=2)] = self._theme.sky
        return grey

    def close(self) -> None:
        """Free the client."""
        bullet.disconnect(self.client)
