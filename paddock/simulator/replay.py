"""Recorded drives of the official simulator, driven again: how far our car is from theirs after a third of a second,
one and two seconds, and how far a plain kinematic bicycle would be."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry

from .car import MAX_STRIDE, Pose
from .physics import PADDOCK_CAR, CarPhysics
from .recording import FRAME_S, Drive, RecordedState
from .response import Response
from .world import World

HORIZONS_S = (0.33, 1.0, 2.0)
NEEDED_S = 1.0  # a recording in which nothing lasts so long says nothing
SETTLE_ROWS = 2  # rows of a drive before its first start state: a car that was just put down still jumps about
HISTORY_ROWS = 9  # rows before a start state from which its inner state is estimated
TRUST = 0.9  # share of the difference in yaw rate that a measured step corrects the estimate by


@dataclass(frozen=True)
class Miss:
    """How far a replayed car is from the recorded one: noses apart in metres, headings apart in degrees."""

    position_m: float
    heading_deg: float


@dataclass(frozen=True)
class Comparison:
    """All start states of a recording: for each horizon the misses of our car and of the bicycle, in the same order."""

    starts: int
    ours: dict[float, list[Miss]]
    bicycle: dict[float, list[Miss]]

    def replayed(self) -> dict[str, int]:
        """How many start states reach each horizon ("0.33", "1", "2")."""
        return {f"{horizon:g}": len(misses) for horizon, misses in self.ours.items()}

    def to_dict(self) -> dict[str, dict[str, dict[str, float | None]]]:
        """Plain JSON values: for each horizon ("0.33", "1", "2") ``median`` and ``p90`` of ``position_m``,
        ``heading_deg``, ``bicycle_position_m`` and ``bicycle_heading_deg``; None where no drive lasts so long."""
        return {
            f"{horizon:g}": {
                "position_m": _spread([miss.position_m for miss in misses], 4),
                "heading_deg": _spread([miss.heading_deg for miss in misses], 2),
                "bicycle_position_m": _spread([miss.position_m for miss in self.bicycle[horizon]], 4),
                "bicycle_heading_deg": _spread([miss.heading_deg for miss in self.bicycle[horizon]], 2),
            }
            for horizon, misses in self.ours.items()
        }


def compare(drives: Sequence[Drive], physics: CarPhysics = PADDOCK_CAR) -> Comparison:
    """Replay the recorded actions from every recorded state that has enough rows before and behind it.

    Both cars are given the recorded pose and the recorded commands at their recorded times; nothing recorded after the
    start state enters. Raises UserFault("trace_too_short") where no drive lasts ``NEEDED_S`` after a start state.
    """
    ours: dict[float, list[Miss]] = {horizon: [] for horizon in HORIZONS_S}
    plain: dict[float, list[Miss]] = {horizon: [] for horizon in HORIZONS_S}
    starts = 0
    with World(physics) as world:
        car = world.add_car()
        for drive, index in _starts(drives):
            starts += 1
            begin = drive[index]
            car.start(begin.pose, estimate(drive, index, physics))
            bicycle = begin.pose
            now, command = 0, begin
            for tick, event in _timetable(drive, index, physics):
                while now < tick:
                    stride = min(tick - now, MAX_STRIDE)
                    world.step(stride)
                    bicycle = _roll(bicycle, command, stride, physics)
                    now += stride
                if isinstance(event, RecordedState):
                    command = event
                    car.command(command.steering_deg, command.speed_mps)
                else:
                    horizon, truth = event
                    ours[horizon].append(_miss(car.pose, truth, physics))
                    plain[horizon].append(_miss(bicycle, truth, physics))
    if not ours[NEEDED_S]:
        raise UserFault("trace_too_short", needed_s=NEEDED_S)
    return Comparison(starts, ours, plain)


def share_on_track(drives: Sequence[Drive], track: TrackGeometry) -> float:
    """Share of the recorded states, 0 to 1, that lie no farther from the centre line than the road is wide: little of
    a recording lies on another track than its own. The ground is flat, so the replay is the same on any.

    The official simulator of 2023 has every track with its middle at the origin, community files mostly have not:
    the track is looked at in both places.
    """
    poses = [state.pose for drive in drives for state in drive]
    middle = (track.centre.min(axis=0) + track.centre.max(axis=0)) / 2.0
    found = [0, 0]
    for pose in poses:
        for number, (dx, dy) in enumerate(((0.0, 0.0), middle.tolist())):
            place = track.project(pose.x + dx, pose.y + dy)
            found[number] += abs(place.offset) <= track.width_at(place.distance)
    return max(found) / len(poses) if poses else 0.0


def estimate(drive: Drive, index: int, physics: CarPhysics = PADDOCK_CAR) -> Response:
    """The inner state (speed, demanded curvature, commands still waiting) of the car that was recorded at ``index``,
    from the rows before it alone.

    The response is driven by the recorded commands of the last ``HISTORY_ROWS`` rows; the yaw rate measured over each
    step corrects its curvature by a share ``TRUST`` of the difference. The measured speed gives its first value only:
    time stamps jitter by 13 %, and the speed follows its commands within a step or two anyway.
    """
    first = max(index - HISTORY_ROWS, 0)
    response = Response(physics, speed=_measured(drive[first], drive[first + 1])[0])
    for row in range(first, index):
        before, after = drive[row], drive[row + 1]
        response.command(before.steering_deg, before.speed_mps)
        ticks = round((after.time - drive[index].time) * physics.tick_hz) - round(
            (before.time - drive[index].time) * physics.tick_hz
        )
        turned = 0.0
        for _ in range(ticks):
            response.advance(1)
            turned += response.speed * response.curvature
        if row > first and ticks:
            missing = _measured(before, after)[1] - turned / ticks
            response.demand += TRUST * missing / max(response.speed, 0.3)
    return response


def _starts(drives: Sequence[Drive]) -> Iterator[tuple[Drive, int]]:
    """Start states: all but the first rows of a drive that reach the shortest horizon."""
    for drive in drives:
        for index in range(SETTLE_ROWS, len(drive)):
            if _row_at(drive, index, HORIZONS_S[0]) is not None:
                yield drive, index


def _row_at(drive: Drive, index: int, horizon: float) -> RecordedState | None:
    """The row whose time is nearest to ``horizon`` seconds after row ``index``; None where the drive ends before."""
    due = drive[index].time + horizon
    if drive[-1].time < due - FRAME_S / 2.0:
        return None
    return min(drive[index:], key=lambda state: abs(state.time - due))


def _timetable(drive: Drive, index: int, physics: CarPhysics) -> list[tuple[int, RecordedState | tuple[float, Pose]]]:
    """What happens at which tick after the start state: commands, and the horizons that the drive reaches,
    each with the row to compare with."""
    begin = drive[index].time
    events: list[tuple[int, RecordedState | tuple[float, Pose]]] = []
    last = 0
    for horizon in HORIZONS_S:
        row = _row_at(drive, index, horizon)
        if row is not None:
            last = round((row.time - begin) * physics.tick_hz)
            events.append((last, (horizon, row.pose)))
    for state in drive[index:]:
        tick = round((state.time - begin) * physics.tick_hz)
        if tick < last:
            events.append((tick, state))
    return sorted(events, key=lambda event: event[0])


def _measured(before: RecordedState, after: RecordedState) -> tuple[float, float]:
    """Speed (m/s, forwards) and yaw rate (rad/s) between two rows."""
    seconds = max(after.time - before.time, 1e-3)
    middle = (before.pose.yaw + after.pose.yaw) / 2.0
    way = (after.pose.x - before.pose.x) * math.cos(middle) + (after.pose.y - before.pose.y) * math.sin(middle)
    return max(way, 0.0) / seconds, (after.pose.yaw - before.pose.yaw) / seconds


def _roll(pose: Pose, command: RecordedState, ticks: int, physics: CarPhysics) -> Pose:
    """A kinematic bicycle with the geometric wheelbase that obeys at once, ``ticks`` ticks later."""
    x, y = pose.ahead(physics.rear_axle_x)
    yaw = pose.yaw
    way = command.speed_mps / physics.tick_hz
    turn = way * math.tan(math.radians(command.steering_deg)) / physics.wheelbase
    for _ in range(ticks):
        x += way * math.cos(yaw + turn / 2.0)
        y += way * math.sin(yaw + turn / 2.0)
        yaw += turn
    return Pose(*Pose(x, y, yaw).ahead(-physics.rear_axle_x), yaw)


def _miss(pose: Pose, truth: Pose, physics: CarPhysics) -> Miss:
    apart = math.dist(pose.ahead(physics.nose_x), truth.ahead(physics.nose_x))
    return Miss(apart, abs(math.degrees(math.remainder(pose.yaw - truth.yaw, 2.0 * math.pi))))


def _spread(values: list[float], digits: int) -> dict[str, float | None]:
    """Median and 90th percentile (linear interpolation)."""
    if not values:
        return {"median": None, "p90": None}
    p90 = statistics.quantiles(values, n=10, method="inclusive")[-1] if len(values) > 1 else values[0]
    return {"median": round(statistics.median(values), digits), "p90": round(p90, digits)}
