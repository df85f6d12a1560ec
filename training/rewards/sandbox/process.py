"""The sandboxed process that checks one reward function and calls it.

``sys.argv[1:]``: modules to import before the lock; then it sends ``{"state": "locked"}``. Answer: ``{"faults",
"warnings", "rewards", "printed"}`` with a reward (or null) for each state reached. ``check``: check the text first, as
in the editor, and try all states; without, stop at the first fault. ``whole``: all states must be reached in the time
of one call, after a first step with ``steps`` 1, as in the field's check; without, states beyond the time are left out.
"""

import sys
import time
import warnings
from typing import TypedDict, cast

from evaluation.sandbox.frames import read_message, write_message
from paddock.errors import Param, UserFault

from . import call_limits
from .allowed_modules import preload
from .function import Params, Reward, StatesOfDrive, from_wire, load_reward
from .hints import hints_of, slowness
from .static_checks import check_text

_EXPENSIVE = ("reward_too_slow", "reward_memory", "reward_prints_too_much")  # no second one is waited for

call_limits.arm()
preload(sys.argv[1:])


def main(frames_in: int, frames_out: int) -> None:
    write_message(frames_out, {"state": "locked"})
    question, _ = read_message(frames_in)
    trial = _Trial(cast("Question", question))
    trial.run()
    warned = [_document(warning, None) for warning in trial.warnings]
    answer = {"faults": trial.faults, "warnings": warned, "rewards": trial.rewards}
    write_message(frames_out, answer | {"printed": call_limits.watch.printed})


class Question(StatesOfDrive):
    """What the client sends."""

    code: str
    check: bool
    whole: bool


class StateFault(TypedDict):
    """A fault, and the number of its state or None."""

    code: str
    params: dict[str, Param]
    state: int | None


class _Trial:
    def __init__(self, question: Question) -> None:
        self._code, self._check, self._whole = question["code"], question["check"], question["whole"]
        self._states = from_wire(question)
        self._began = time.process_time()
        self.faults: list[StateFault] = []
        self.warnings: list[UserFault] = []
        self.rewards: list[float | None] = []
        self._call_ms: list[float] = []

    def run(self) -> None:
        if self._check:
            self.faults = [_document(fault, None) for fault in check_text(self._code)]
            if self.faults:
                return
            self.warnings = hints_of(self._code)
            self._began = time.process_time()
        try:
            reward = load_reward(self._code)
        except UserFault as fault:
            self.faults = [_document(fault, None)]
            return
        load_ms = 1000.0 * (time.process_time() - self._began)
        first = self._first_step(reward) if self._whole and self._states else None
        if first is not None and first.code in _EXPENSIVE:
            self._note(first, 0)
            return
        for number, params in enumerate(self._states):
            try:
                self.rewards.append(self._call(reward, params))
            except UserFault as fault:
                if self._out_of_time(fault):
                    break
                self.rewards.append(None)
                self._note(fault, number)
                if fault.code in _EXPENSIVE or not self._check:
                    break
        else:
            self.warnings += slowness(self._call_ms, load_ms)
        if first is not None:
            self._note(first, 0)

    def _call(self, reward: Reward, params: Params) -> float:
        # All calls together have the time of one.
        began = time.process_time()
        call_limits.watch.limit_s = call_limits.LIMIT_S - (began - self._began)
        try:
            return reward(params)
        finally:
            self._call_ms.append(1000.0 * (time.process_time() - began))

    def _first_step(self, reward: Reward) -> UserFault | None:
        """What keeps something of an episode's first step may look for ``steps`` 1. Prints are not kept."""
        call_limits.watch.muted = True
        try:
            with warnings.catch_warnings(action="ignore"):  # each line warns once: in the first state that counts
                self._call(reward, {**self._states[0], "steps": 1})
        except UserFault as fault:
            return fault
        finally:
            call_limits.watch.muted = False
        return None

    def _note(self, fault: UserFault, state: int) -> None:
        found = _document(fault, state)
        if all((found["code"], found["params"]) != (other["code"], other["params"]) for other in self.faults):
            self.faults.append(found)

    def _out_of_time(self, fault: UserFault) -> bool:
        """Whether many calls together took the time of one, and may leave the rest out; then that is a warning."""
        *before, last = self._call_ms
        if self._whole or fault.code != "reward_too_slow" or not before or last >= 1000.0 * call_limits.LIMIT_S / 2:
            return False
        mean = round(sum(before) / len(before), 1)
        total = len(self._states)
        self.warnings.append(UserFault("reward_slow_in_all", ms=str(mean), count=len(before), total=total))
        return True


def _document(fault: UserFault, state: int | None) -> StateFault:
    return {"code": fault.code, "params": fault.params, "state": state}
