"""Reward functions in the field's form: ``reward_function(params) -> float`` with the documented keys."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .contestant import Contestant
from .trace import OFF_TRACK

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


def reward_params(car: Contestant, waypoints: list[tuple[float, float]], is_reversed: bool) -> Params:
    """The ``params`` of a car's present state (deepracer-simapp, agent_ctrl/constants.py, RewardParam).

    ``speed`` and ``steering_angle`` are those of the last command, x and y those of the nose. ``waypoints`` is handed
    over as it is. In a time trial the object lists are empty.
    """
    referee = car.referee
    track, place = referee.track, referee.odometer.place
    x, y = referee.pose.ahead(car.car.physics.nose_x)
    off_track = car.status == OFF_TRACK
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
        "closest_objects": [0, 0],
        "objects_location": [],
        "objects_left_of_center": [],
        "object_in_camera": False,
        "objects_speed": [],
        "objects_heading": [],
        "objects_distance_from_center": [],
        "objects_distance": [],
        "is_crashed": False,
        "is_offtrack": off_track,
        "sim_time": referee.time_ms / 1000.0,
    }
