"""Reads recorded drives of the official simulator (sim-traces) and measures how far our car deviates from them."""

import csv
import io
import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry

from .car import MAX_STRIDE, Pose
from .physics import PADDOCK_CAR, CarPhysics
from .response import Response
from .trace import PAUSE, PREPARE
from .world import World

COLUMNS = ("episode", "X", "Y", "yaw", "steer", "throttle", "tstamp", "episode_status")
ON_THE_ROAD = "in_progress"
MAX_BYTES = 64 * 1024 * 1024
MAX_GAP_S = 0.25  # between two rows of a drive; simapp's longest measured step is 0.15 s
MAX_SPEED_MPS = 5.5  # a car that moves faster between two rows was put elsewhere; the fastest command is 4 m/s
FRAME_S = 1.0 / 15.0
MAX_NUMBER = 1e10  # times of day in seconds are a fifth of it


@dataclass(frozen=True)
class RecordedState:
    """A row: time (s), pose of the base and command (degrees to the left, m/s)."""

    time: float
    pose: Pose  # yaw runs on beyond a half turn, so that headings of one drive can be subtracted
    steering_deg: float
    speed_mps: float


Drive = Sequence[RecordedState]
"""Rows that follow each other without a jump."""


def read_drives(data: bytes, physics: CarPhysics = PADDOCK_CAR) -> list[Drive]:
    """Every stretch that a recorded car drove without a reset: a drive ends with its episode, its lap, a fault or a
    jump.

    Needs the columns of ``COLUMNS``, in any order. X and Y (m) are the nose, yaw is in degrees. The time stamp of a row
    is that of the end of its step, so a state's time is the stamp of the row before.

    Raises UserFault: ``trace_too_large``, ``trace_not_csv``, ``trace_columns_missing``, ``trace_column_twice``,
    ``trace_not_a_number``, ``trace_number_too_large``, ``trace_out_of_order``.
    """
    if len(data) > MAX_BYTES:
        raise UserFault("trace_too_large", limit_mb=MAX_BYTES // 1024**2)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UserFault("trace_not_csv") from None
    if "\0" in text:
        raise UserFault("trace_not_csv")
    rows = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    drives: list[list[RecordedState]] = []
    drive: list[RecordedState] = []
    episode = stamp = None
    try:
        names = rows.fieldnames or []
        missing = [name for name in COLUMNS if name not in names]
        if missing:
            raise UserFault("trace_columns_missing", columns=", ".join(missing))
        twice = [name for name in COLUMNS if names.count(name) > 1]
        if twice:
            raise UserFault("trace_column_twice", columns=", ".join(twice))
        for row in rows:
            values = {name: _number(row, name, rows.line_num) for name in COLUMNS[1:-1]}
            status = (row["episode_status"] or "").strip()
            if row["episode"] != episode:
                episode, stamp, drive = row["episode"], None, []
            now = values["tstamp"]
            if stamp is not None and now < stamp:
                raise UserFault("trace_out_of_order", row=rows.line_num)
            time = now - FRAME_S if stamp is None else stamp
            stamp = now
            if status in (PREPARE, PAUSE):
                drive = []
                continue
            state = _state(values, time, drive[-1].pose.yaw if drive else None, physics)
            if not drive or _jumped(drive[-1], state):
                drive = []
                drives.append(drive)
            drive.append(state)
            if status != ON_THE_ROAD:
                drive = []
    except csv.Error:
        raise UserFault("trace_not_csv") from None
    return [drive for drive in drives if len(drive) > 1]


def _number(row: dict[str, str | None], name: str, line: int) -> float:
    """A number of at most ``MAX_NUMBER``. Raises UserFault: ``trace_not_a_number``, ``trace_number_too_large``."""
    text = row[name]
    try:
        value = float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        shown = "nothing" if text is None else text[:40]
        raise UserFault("trace_not_a_number", row=line, column=name, value=shown)
    if abs(value) > MAX_NUMBER:
        raise UserFault("trace_number_too_large", row=line, column=name, value=f"{value:g}", limit=f"{MAX_NUMBER:g}")
    return value


def _state(values: dict[str, float], time: float, yaw_before: float | None, physics: CarPhysics) -> RecordedState:
    yaw = math.radians(values["yaw"])
    if yaw_before is not None:
        yaw = yaw_before + math.remainder(yaw - yaw_before, 2.0 * math.pi)
    x, y = Pose(values["X"], values["Y"], yaw).ahead(-physics.nose_x)
    return RecordedState(time, Pose(x, y, yaw), values["steer"], values["throttle"])


def _jumped(before: RecordedState, after: RecordedState) -> bool:
    seconds = after.time - before.time
    apart = math.hypot(after.pose.x - before.pose.x, after.pose.y - before.pose.y)
    return seconds > MAX_GAP_S or apart > MAX_SPEED_MPS * max(seconds, FRAME_S)


HORIZONS_S = (0.33, 1.0, 2.0)
NEEDED_S = 1.0  # shorter recordings are not evaluated
SETTLE_ROWS = 2  # rows of a drive before its first start state
HISTORY_ROWS = 9  # rows before a start state from which its inner state is estimated
TRUST = 0.9  # share of the difference in yaw rate that a measured step corrects the estimate by


@dataclass(frozen=True)
class Miss:
    """Distance of a replayed car from the recorded one: of the noses in metres, of the headings in degrees."""

    position_m: float
    heading_deg: float


@dataclass(frozen=True)
class Comparison:
    """The misses of our car and of a kinematic bicycle for each horizon, in the same order of start states."""

    starts: int
    ours: dict[float, list[Miss]]
    bicycle: dict[float, list[Miss]]

    def replayed(self) -> dict[str, int]:
        """The number of start states that reach each horizon ("0.33", "1", "2")."""
        return {f"{horizon:g}": len(misses) for horizon, misses in self.ours.items()}

    def to_dict(self) -> dict[str, dict[str, dict[str, float | None]]]:
        """Plain JSON values for each horizon ("0.33", "1", "2"); None where no drive lasts so long."""
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

    Both cars get the recorded pose and the recorded commands at their recorded times. Raises
    UserFault("trace_too_short") where no drive lasts ``NEEDED_S`` after a start state.
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
    """Share of the recorded states, 0 to 1, that lie within a road's width of the centre line.

    The official simulator of 2023 has every track with its middle at the origin, which most community files have not:
    the better of both places counts.
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
    """The inner state of the car that was recorded at ``index``, from the rows before it alone.

    The recorded commands of the last ``HISTORY_ROWS`` rows drive the response; the yaw rate measured over each step
    corrects its curvature by a share ``TRUST`` of the difference. The measured speed gives its first value only, as
    time stamps jitter by 13 %.
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
    """The row nearest to ``horizon`` seconds after row ``index``; None where the drive ends before."""
    due = drive[index].time + horizon
    if drive[-1].time < due - FRAME_S / 2.0:
        return None
    return min(drive[index:], key=lambda state: abs(state.time - due))


def _timetable(drive: Drive, index: int, physics: CarPhysics) -> list[tuple[int, RecordedState | tuple[float, Pose]]]:
    """Commands and reached horizons (each with its recorded pose) by their ticks after the start state."""
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
