"""Drives the uneventful control steps of a single car in C (cruise.c), if possible as far as the next answer of its
network (exchange.c)."""

# Nearly every step of a time trial crosses no line and has no fault. Python needs dozens of slow calls to find that
# out, because the network evicts the caches. While a car cruises, its state is one C struct; :meth:`Cruise.settle`
# copies it back to the competitor and its referee, which judge every event.

from __future__ import annotations

import ctypes
import math
import struct
from typing import TYPE_CHECKING, Protocol

import numpy as np

from paddock.geometry.road import BAND_M, ON_LINE_M
from paddock.geometry.segments import ROUNDING_M
from paddock.geometry.track import WINDOW_M

from . import compiled
from .action import Action
from .car import Pose
from .competitor import Competitor
from .progress import Projection
from .referee import PATIENCE_STEPS, SURELY_M
from .trace import IN_PROGRESS, STATES

if TYPE_CHECKING:
    from .race import Entrant

ROWS = 256  # steps between two calls of settle
_NOT_THIS_ONE, _NOTHING_HAPPENED, _, _UNSURE, _ANSWERED = range(5)

_library = compiled.library()


class _State(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("segments", "gains", "half_widths")),
        ("count", ctypes.c_int64),
        ("length", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("edges", "bands")),
        ("band_count", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("low_m", "band_m", "on_line_m", "rounding_m", "window_m")),
        *((name, ctypes.c_double) for name in ("nose_m", "front_m", "rear_m", "side_m")),
        *((name, ctypes.c_double) for name in ("surely_m", "clear_m", "clear_from", "clear_to", "line_m")),
        *((name, ctypes.c_int64) for name in ("last_step", "patience")),
        *((name, ctypes.c_double) for name in ("new_x", "new_y", "new_yaw", "cos", "sin")),
        *((name, ctypes.c_double) for name in ("steering_deg", "speed_mps")),
        ("index", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("x", "y", "older_x", "older_y")),
        *((name, ctypes.c_double) for name in ("base_x", "base_y", "yaw", "before_x", "before_y", "before_yaw")),
        *((name, ctypes.c_double) for name in ("metres", "before_m", "distance", "offset", "tx", "ty")),
        *((name, ctypes.c_int64) for name in ("segment", "step", "lap_steps", "reversing", "clear", "all_wheels")),
        ("rows", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("room", "used")),
    ]


class _Stride(ctypes.Structure):
    camera_s: float
    policy_s: float
    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("car", "x", "y", "cosine", "sine", "view", "frame", "asked")),
        *((name, ctypes.c_double) for name in ("camera_s", "policy_s")),
    ]


class AskedPolicy(Protocol):
    """A policy that is asked in C. ``address``: of its ``struct exchange``, 0 for none."""

    address: int

    def answer(self) -> list[float]:
        """The answer, where it was good."""

    def answer_by_hand(self) -> list[float]:
        """The answer, where C left it to Python. Raises UserFault."""


_NEW_STATE, _NEW_STATE_AT = struct.Struct("=7dq"), _State.new_x.offset


class Cruise:
    """A competitor that drives alone. While :attr:`on`, it and its referee are out of date: call :meth:`settle` before
    you read them."""

    def __init__(self, competitor: Competitor, library: ctypes.CDLL, entrant: Entrant | None) -> None:
        self.on = False
        self._competitor, self._car, self._referee = competitor, competitor.car, competitor.referee
        track, judged_by = self._referee.track, self._referee.constants()
        self._held = held = {
            "segments": track.segment_rows,
            "gains": np.array(self._referee.odometer.gains),
            "half_widths": track.half_widths,
            "edges": track.road.rows[0],
            "bands": track.road.rows[1],
        }
        self._rows = np.zeros(ROWS, STATES)
        self._rows["status"] = IN_PROGRESS
        self._state = _State(
            **{name: array.ctypes.data for name, array in held.items()},
            count=len(track.segment_rows),
            band_count=len(track.road.rows[1]) - 1,
            low_m=track.road.low_m,
            band_m=BAND_M,
            on_line_m=ON_LINE_M,
            rounding_m=ROUNDING_M,
            window_m=WINDOW_M,
            length=track.length,
            rows=self._rows.ctypes.data,
            room=ROWS,
            patience=PATIENCE_STEPS,
            surely_m=SURELY_M,
            **judged_by,
        )
        self._stride = _Stride(car=ctypes.addressof(self._state))
        self._at = self._stride.car
        self._call = library.paddock_cruise
        if entrant is not None and self._can_ask(entrant):
            self._at, self._call = ctypes.addressof(self._stride), library.paddock_stride
        self._call.argtypes, self._call.restype = (ctypes.c_void_p,), ctypes.c_int64
        self._action: Action = competitor.action

    def _can_ask(self, entrant: Entrant) -> bool:
        """Whether C can ask the car's network; it does from then on."""
        if entrant.asked is None or not entrant.asked.address:
            return False
        drawing = self._competitor.drawing_in(entrant.places)
        if drawing is None:
            return False
        stride, at = self._stride, self._stride.car
        stride.view, stride.frame = drawing
        stride.asked = entrant.asked.address
        self._entrant, self._asked, self._commands = entrant, entrant.asked, entrant.action_space.commands
        stride.x, stride.y, stride.cosine, stride.sine = (
            at + getattr(_State, name).offset for name in ("new_x", "new_y", "cos", "sin")
        )
        return True

    @property
    def camera_s(self) -> float:
        return self._stride.camera_s

    @property
    def policy_s(self) -> float:
        return self._stride.policy_s

    @classmethod
    def of(cls, competitor: Competitor, entrant: Entrant | None = None) -> Cruise | None:
        """``entrant``: whose network is asked at the end of a step. None without the compiled library, on an open track
        and with boxes."""
        referee = competitor.referee
        if _library is None or referee.track.is_open or referee.boxes.next_m < math.inf:
            return None
        return cls(competitor, _library, entrant)

    def begin(self) -> None:
        """Cruise from the next step on, unless the referee has something to judge."""
        competitor, referee, state = self._competitor, self._referee, self._state
        if competitor.status != IN_PROGRESS or not referee.is_calm:
            return
        self._rows["lap"], self._rows["crashes"] = referee.laps[-1].number, referee.crashes
        self._rows["reward"] = competitor.reward
        odometer, (older, nose) = referee.odometer, referee.noses
        state.x, state.y = nose
        state.older_x, state.older_y = older
        state.base_x, state.base_y, state.yaw = referee.pose
        state.metres, (state.distance, _, _, state.segment) = odometer.metres, odometer.place
        state.line_m, state.reversing = referee.line_m, referee.reversing
        state.step, state.lap_steps, state.all_wheels = referee.step, competitor.lap_steps, referee.all_wheels_on_track
        state.used = 0
        self.on = True

    def step(self, action: Action) -> Action | None:
        """The car received ``action`` and the world advanced; settle and judge a step with an event. Returns the action
        of the next step, if the network was asked for it; raises what its policy would."""
        pose = self._car.pose
        x, y, yaw = pose
        steering_deg, speed_mps, index = self._action = action
        new_state = (x, y, yaw, math.cos(yaw), math.sin(yaw), steering_deg, speed_mps, -1 if index is None else index)
        _NEW_STATE.pack_into(self._state, _NEW_STATE_AT, *new_state)
        outcome = self._call(self._at)
        if outcome >= _UNSURE:
            if outcome > _UNSURE and self._commands:
                return self._commands[outcome - _ANSWERED]
            answer = self._asked.answer() if outcome > _UNSURE else self._asked.answer_by_hand()
            return self._entrant.action_space.decode(answer)
        if outcome == _NOTHING_HAPPENED or (outcome != _NOT_THIS_ONE and self._is_on_road(pose)):
            return None
        self.settle()
        if outcome == _NOT_THIS_ONE:
            self._competitor.note(action)
            self._competitor.move()
        self._competitor.judge()
        return None

    def _is_on_road(self, pose: Pose) -> bool:
        """Whether a car near the borders is on its part of the road."""
        state, wheels = self._state, self._referee.wheels(pose)
        state.all_wheels = all(wheels)
        return any(wheels) and not self._referee.is_elsewhere(state.distance, state.offset)

    def settle(self) -> None:
        """Bring competitor and referee up to date, as if they had seen every step."""
        if not self.on:
            return
        self.on = False
        state = self._state
        if not state.used:
            return
        self._competitor.cruised(self._action, state.lap_steps, self._rows[: state.used].copy())
        place = Projection(state.distance, state.offset, math.atan2(state.ty, state.tx), state.segment)
        self._referee.odometer.settle(state.metres, place)
        pose = Pose(state.base_x, state.base_y, state.yaw)
        self._referee.cruised(
            step=state.step,
            poses=(Pose(state.before_x, state.before_y, state.before_yaw), pose),
            noses=((state.older_x, state.older_y), (state.x, state.y)),
            before_m=state.before_m,
            reversing=state.reversing,
            clear=bool(state.clear),
            wheels=[] if state.clear else self._referee.wheels(pose),
            all_wheels=bool(state.all_wheels),
        )
