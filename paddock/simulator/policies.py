"""A scripted driver for tests and benchmarks."""

import math

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import INNER

from .action import ActionSpace
from .layout import EMPTY, Layout
from .physics import PADDOCK_CAR
from .sensors import POSE

_AHEAD_M, _AHEAD_S = 0.25, 0.2  # look-ahead: metres at rest, and seconds of driving on top
_CORNERING = 2.0  # m/s^2 sideways; more, and the car leaves the sharpest corners by its own width
_BEFORE_BOX_M, _AFTER_BOX_M = 2.0, 0.45  # from its base to a box's middle: there it drives in the other lane


class CentreLinePilot:
    """Follows a line at a constant offset from the centre line, by pose instead of by picture; one for each run::

    pilot = CentreLinePilot(track, direction="cw")
    run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    """

    sensors = (POSE,)
    action_space = ActionSpace.continuous(
        (-PADDOCK_CAR.max_steering_deg, PADDOCK_CAR.max_steering_deg), (PADDOCK_CAR.min_speed, PADDOCK_CAR.max_speed)
    )

    def __init__(
        self,
        track: TrackGeometry,
        direction: str = "ccw",
        speed: float = 1.5,
        offset: float = 0.0,
        layout: Layout = EMPTY,
    ) -> None:
        """``speed``: m/s on straights; ``offset``: metres to the left of the centre line. Past the boxes of ``layout``
        it drives in the other lane."""
        self._track = track.in_direction(direction)
        self._speed = speed
        self._offset = offset
        self._boxes = layout.boxes
        self._index: int | None = None

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        """Two values in [-1, 1] from ``readings["POSE"]``: x, y (m), yaw (rad), speed (m/s)."""
        x, y, yaw, rolling = readings[POSE].tolist()
        track, physics = self._track, PADDOCK_CAR
        place = track.project(x, y, self._index)
        if abs(place.offset) > track.width_at(place.distance):  # put back elsewhere
            place = track.project(x, y)
        self._index = place.index

        # pure pursuit
        aim_m = place.distance + _AHEAD_M + _AHEAD_S * rolling
        aim_x, aim_y, _ = track.point_at(aim_m, self._offset_for(place.distance, aim_m))
        bearing = math.remainder(math.atan2(aim_y - y, aim_x - x) - yaw, 2 * math.pi)
        curvature = 2 * math.sin(bearing) / max(math.hypot(aim_x - x, aim_y - y), 0.05)
        angle = math.degrees(math.atan(physics.demand(curvature, rolling) * physics.effective_wheelbase))
        steering = min(max(angle, -physics.max_steering_deg), physics.max_steering_deg)

        turns = [
            abs(math.remainder(track.point_at(place.distance + ahead)[2] - place.heading, 2 * math.pi)) / ahead
            for ahead in (0.5, 1.0, 1.5)
        ]
        speed = max(min(self._speed, math.sqrt(_CORNERING / max(*turns, 0.1))), physics.min_speed)
        span = physics.max_speed - physics.min_speed
        return np.array(
            (steering / physics.max_steering_deg, 2 * (speed - physics.min_speed) / span - 1), dtype=np.float32
        )

    def _offset_for(self, metres: float, aim_m: float) -> float:
        """Offset at ``aim_m`` of the line for a car at ``metres``: beside the first box near the middle of its lane."""
        track = self._track
        for box in self._boxes:
            if (box.metres - metres + _AFTER_BOX_M) % track.length < _BEFORE_BOX_M + _AFTER_BOX_M:
                left, right = track.half_widths_at(aim_m)
                box_on_the_left = (box.lane == INNER) == (track.direction == "ccw")
                return -right / 2 if box_on_the_left else left / 2
        return self._offset
