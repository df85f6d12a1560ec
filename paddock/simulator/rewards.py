"""The parameters of reward functions in the field's form, ``reward_function(params) -> float``."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

from paddock.geometry.track import Projection, TrackGeometry

from .camera.blocks import NEAR_M
from .camera.optics import FRONT_CAMERA
from .car import Pose
from .competitor import Competitor
from .solids import CAR, Solid
from .trace import CRASHED, OFF_TRACK

Params = dict[str, Any]
RewardFunction = Callable[[Params], float]


def follow_centre_line(params: Params) -> float:
    """The console's default: 1, 0.5 or 0.1 within a tenth, a quarter or half of the width from the centre line
    (AWS DeepRacer developer guide, reward function examples)."""
    distance, width = params["distance_from_center"], params["track_width"]
    for share, reward in ((0.1, 1.0), (0.25, 0.5), (0.5, 0.1)):
        if distance <= share * width:
            return reward
    return 1e-3


def avoid_objects(params: Params) -> float:
    """The guide's example for object avoidance and head-to-head: stay on the road (weight 1) and away from the next
    object in the same lane (weight 4)."""
    inside = params["all_wheels_on_track"] and 0.5 * params["track_width"] - params["distance_from_center"] >= 0.05
    avoided = 1.0
    if params["objects_location"]:
        ahead = params["closest_objects"][1]
        if params["objects_left_of_center"][ahead] == params["is_left_of_center"]:
            distance = math.dist((params["x"], params["y"]), params["objects_location"][ahead])
            avoided = next((share for least, share in ((0.8, 1.0), (0.5, 0.5), (0.3, 0.2)) if distance >= least), 1e-3)
    if params["is_crashed"]:
        avoided = 1e-3
    return (1.0 if inside else 1e-3) + 4.0 * avoided


def reward_params(
    car: Competitor, waypoints: list[tuple[float, float]], is_reversed: bool, objects: Params | None = None
) -> Params:
    """The ``params`` of a car's present state (deepracer-simapp, agent_ctrl/constants.py, RewardParam).

    ``speed`` and ``steering_angle`` are those of the last command, x and y those of the nose. ``objects``: see
    :meth:`Objects.params`; without, its keys have their defaults.
    """
    referee = car.referee
    track, place = referee.track, referee.odometer.place
    x, y = referee.pose.ahead(car.car.physics.nose_x)
    return {
        "all_wheels_on_track": referee.all_wheels_on_track,
        "x": x,
        "y": y,
        "heading": math.degrees(referee.pose.yaw),
        "distance_from_center": abs(place.offset),
        "projection_distance": place.distance,
        "progress": referee.percent,
        "steps": int(car.lap_steps),
        "speed": car.action.speed_mps,
        "steering_angle": car.action.steering_deg,
        "track_width": track.width_at(place.distance),
        "track_length": track.length,
        "waypoints": waypoints,
        "closest_waypoints": [place.index, (place.index + 1) % len(track)],
        "is_left_of_center": place.offset > 0,
        "is_reversed": is_reversed,
        **(objects or _nothing()),
        "is_crashed": car.status == CRASHED,
        "is_offtrack": car.status == OFF_TRACK,
        "sim_time": referee.time_ms / 1000.0,
    }


def _nothing() -> Params:
    return {
        "closest_objects": [0, 0],
        "objects_location": [],
        "objects_left_of_center": [],
        "object_in_camera": False,
        "objects_speed": [],
        "objects_heading": [],
        "objects_distance_from_center": [],
        "objects_distance": [],
    }


class Objects:
    """The object keys of ``params`` (deepracer-simapp, track_geom/track_data.py, get_object_reward_params), in the
    order of :meth:`.stage.Simulation.solids`."""

    def __init__(self, track: TrackGeometry, car_speed_mps: float = 0.0) -> None:
        """``car_speed_mps``: of bots, which counts for every car among the objects."""
        self._track = track
        self._car_speed = car_speed_mps
        self._seen: list[tuple[Solid, Projection]] = []

    def params(self, pose: Pose, distance: float, solids: Sequence[Solid]) -> Params:
        """The object keys for a car at ``pose`` whose nose is ``distance`` metres after the finish line."""
        if not solids:
            return _nothing()
        places = self._projected(solids)
        behind, ahead = _neighbours([place.distance for place in places], distance, self._track.is_open)
        return {
            "closest_objects": [behind, ahead],
            "objects_location": [(solid.x, solid.y) for solid in solids],
            "objects_left_of_center": [place.offset > 0 for place in places],
            "object_in_camera": in_camera(pose, solids[ahead]),
            "objects_speed": [self._car_speed if solid.look == CAR else 0.0 for solid in solids],
            # Radians, and 0 for boxes, as the original's code has it (its documentation has degrees).
            "objects_heading": [solid.yaw if solid.look == CAR else 0.0 for solid in solids],
            "objects_distance_from_center": [abs(place.offset) for place in places],
            "objects_distance": [place.distance for place in places],
        }

    def _projected(self, solids: Sequence[Solid]) -> list[Projection]:
        """The projections of the solids, cached for those that have not moved."""
        seen, project = self._seen, self._track.project
        known = len(seen) == len(solids)
        self._seen = [
            seen[number]
            if known and seen[number][0] == solid
            else (solid, project(solid.x, solid.y, seen[number][1].index if known else None))
            for number, solid in enumerate(solids)
        ]
        return [place for _, place in self._seen]


def _neighbours(distances: list[float], distance: float, is_open: bool) -> tuple[int, int]:
    """Indices of the object behind and of the one ahead along the track; the same twice for a single one and at the
    ends of an open track."""
    order = sorted(range(len(distances)), key=distances.__getitem__)
    after = bisect_right([distances[number] for number in order], distance)
    if is_open:
        return order[max(after - 1, 0)], order[min(after, len(order) - 1)]
    return order[after - 1], order[after % len(order)]


def in_camera(pose: Pose, solid: Solid) -> bool:
    """True where the middle or a corner of the solid's floor lies in the front camera's view, hidden or not
    (deepracer-simapp, cameras/frustum.py by way of get_objects_in_camera_frustums)."""
    optics = FRONT_CAMERA
    wide = math.tan(optics.horizontal_fov / 2)
    high = wide * optics.rows / optics.columns
    cos, sin = math.cos(optics.pitch), math.sin(optics.pitch)
    heading_x, heading_y = math.cos(pose.yaw), math.sin(pose.yaw)
    corner = Pose(solid.x, solid.y, solid.yaw).ahead
    for length, width in ((0, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)):
        x, y = corner(length * solid.half_length, width * solid.half_width)
        dx, dy = x - pose.x, y - pose.y
        forward, left = dx * heading_x + dy * heading_y - optics.x, dy * heading_x - dx * heading_y - optics.y
        depth = forward * cos + optics.height * sin
        down = optics.height * cos - forward * sin
        if depth >= NEAR_M and abs(left) <= wide * depth and abs(down) <= high * depth:
            return True
    return False
