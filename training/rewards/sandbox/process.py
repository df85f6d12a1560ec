"""The sandboxed process that checks one reward function and calls it.

``sys.argv[1:]``: modules to import before the lock; then it sends ``{"state": "locked"}``. Answer: ``{"faults",
"warnings", "rewards", "printed"}`` with a reward (or null) for each state reached. ``check``: check the text first, as
in the editor, and try all states; without, stop at the first fault. ``whole``: all states must be reached in the time
of one call, after a first step with ``steps`` 1, as in the field's check; without, states beyond the time are left out.
``drives``: of an audit, the number of the first state of each drive, before which the function is loaded again; faults
have the ``count`` of states then.
"""

import sys
import time
import warnings
from itertools import pairwise
from types import CodeType
from typing import TypedDict, cast

from evaluation.sandbox.frames import LOCKED, read_message, write_message
from paddock.errors import Param, UserFault

from . import call_limits
from .allowed_modules import preload
from .foreign_params import AskingReward, foreign_params
from .function import Params, Reward, StatesOfDrive, compile_reward, from_wire, load_reward
from .hints import hints_of, slowness
from .static_checks import check_text

_MOST_FAULTS = 20
_JUMP = 5.0  # times the greatest reward: so much changes where a function does not notice a new episode
_EXPENSIVE = ("reward_too_slow", "reward_memory", "reward_prints_too_much")  # no second one is waited for

call_limits.arm()
preload(sys.argv[1:])


def main(frames_in: int, frames_out: int) -> None:
    write_message(frames_out, LOCKED)
    question, _ = read_message(frames_in)
    trial = (_AuditTrial if question.get("drives") else _Trial)(cast("Question", question))
    trial.run()
    warned = [_document(warning, None) for warning in trial.warnings]
    answer = {"faults": trial.faults, "warnings": warned, "rewards": trial.rewards}
    write_message(frames_out, answer | {"printed": call_limits.watch.printed})


class Question(StatesOfDrive):
    """What the client sends."""

    code: str
    check: bool
    whole: bool
    drives: list[int]


class StateFault(TypedDict):
    """A fault, and the number of its state or None."""

    code: str
    params: dict[str, Param]
    state: int | None
    count: int


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
        if self._drive(reward, 0, len(self._states)):
            self.warnings += slowness(self._call_ms, load_ms)
        if first is not None:
            self._note(first, 0)

    def _drive(self, reward: Reward, begin: int, end: int) -> bool:
        """Whether all states were reached."""
        for number in range(begin, end):
            try:
                self.rewards.append(self._call(reward, self._states[number]))
            except UserFault as fault:
                if self._out_of_time(fault):
                    return False
                self.rewards.append(None)
                self._note(fault, number)
                if fault.code in _EXPENSIVE or not self._check:
                    return False
        return True

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

    def _note(self, fault: UserFault, state: int | None) -> None:
        found = _document(fault, state)
        if all((found["code"], found["params"]) != (other["code"], other["params"]) for other in self.faults):
            self.faults.append(found)

    def _out_of_time(self, fault: UserFault) -> bool:
        """Whether many calls together took the time of one, and may leave the rest out; then that is a warning."""
        *before, last = self._call_ms
        if self._whole or fault.code != "reward_too_slow" or not before or last >= 1000.0 * call_limits.LIMIT_S / 2:
            return False
        self._say_slow(before)
        return True

    def _say_slow(self, call_ms: list[float]) -> None:
        mean, total = round(sum(call_ms) / len(call_ms), 1), len(self._states)
        self.warnings.append(UserFault("reward_slow_in_all", ms=str(mean), count=len(call_ms), total=total))


def _document(fault: UserFault, state: int | None) -> StateFault:
    return {"code": fault.code, "params": fault.params, "state": state, "count": 1}


class _AuditTrial(_Trial):
    """Eight drives, each with a function that is loaded again."""

    def __init__(self, question: Question) -> None:
        super().__init__(question)
        self._drives = [*question["drives"], len(self._states)]

    def run(self) -> None:
        self.faults = [_document(fault, None) for fault in check_text(self._code)]
        if self.faults:
            return
        self.warnings = hints_of(self._code)
        program = compile_reward(self._code)
        self._began = time.process_time()
        missed: dict[str, int] = {}
        first: Reward | None = None
        complete, loads = True, []
        for begin, end in pairwise(self._drives):
            call_limits.watch.limit_s = call_limits.LIMIT_S - (time.process_time() - self._began)
            loading = time.process_time()
            try:
                reward = AskingReward(program, missed)
            except UserFault as fault:
                if first is None or fault.code != "reward_too_slow":
                    self._note(fault, None)
                else:
                    self._say_slow(self._call_ms)
                complete = False
                break
            loads.append(1000.0 * (time.process_time() - loading))
            call_limits.watch.muted = first is not None  # the output of one drive is enough
            complete = self._drive(reward, begin, end)
            first = first or reward
            if not complete:
                break
        call_limits.watch.muted = True
        if complete and first is not None and not self.faults:
            self._drive_again(first, program)
        call_limits.watch.muted = False
        if complete:
            self.warnings += slowness(self._call_ms, loads[0])
        self.warnings += foreign_params(self._code, self._states[0], missed)

    def _drive_again(self, used: Reward, program: CodeType) -> None:
        """Drive the shortest drive again, by a new function and after another drive by one that was used."""
        begin, end = min(pairwise(self._drives), key=lambda drive: drive[1] - drive[0])
        before = self.rewards[begin:end]
        most = 0.0
        try:
            for code, reward in (("reward_is_random", Reward(program)), ("reward_remembers", used)):
                now = [self._call(reward, state) for state in self._states[begin:end]]
                change = max(abs(new - (old or 0.0)) for new, old in zip(now, before, strict=True))
                if change > most:
                    self.warnings.append(UserFault(code))
                    return
                most = _JUMP * max(map(abs, now))  # the first step may know less of the one before it
        except UserFault:  # out of time
            return

    def _note(self, fault: UserFault, state: int | None) -> None:
        """One fault for a code and a line, with the first state and the number of states."""
        for other in self.faults:
            if other["code"] == fault.code and other["params"].get("line") == fault.params.get("line"):
                other["count"] += 1
                return
        if len(self.faults) < _MOST_FAULTS:
            self.faults.append(_document(fault, state))
