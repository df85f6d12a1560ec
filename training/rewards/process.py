"""In the sandbox: checks one reward function, calls it with the states that it is sent, and answers.

``sys.argv[1:]``: modules to import before the lock (:func:`.modules.wanted_modules`). It says ``{"state": "locked"}``
when it can be asked. Question: ``{"code", "check", "whole", "waypoints", "states"}``. Answer: ``{"faults": [{"code",
"params", "state"}], "warnings": [the same], "rewards": [...], "printed"}`` with a reward (or null) for each state that
was come to. ``check``: whether the text is checked first, as in the editor; and all states are tried,
where otherwise the first fault is the end. ``whole``: all states must be come to in the time of one call, and before
them a first step with ``steps`` 1 is tried, as the field's check does; otherwise what there was no time for is left
out.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any

from evaluation.sandbox.frames import read_message, write_message
from paddock.errors import UserFault

from . import watch
from .check import check_text
from .function import Params, Reward, load_reward
from .hints import hints_of
from .modules import preload
from .speed import slowness
from .wire import from_wire

_EXPENSIVE = ("reward_too_slow", "reward_memory", "reward_prints_too_much")  # no second one is waited for

watch.arm()
preload(sys.argv[1:])


def main(frames_in: int, frames_out: int) -> None:
    """Answer one question; see the module."""
    write_message(frames_out, {"state": "locked"})
    question, _ = read_message(frames_in)
    answer = _Trial(question).answer()
    write_message(frames_out, answer | {"printed": watch.watch.printed})


class _Trial:
    """One function, tried on the states of a question."""

    def __init__(self, question: dict[str, Any]) -> None:
        self._code, self._check, self._whole = question["code"], question["check"], question["whole"]
        self._states = from_wire(question)
        self._began = time.process_time()
        self._faults: list[dict[str, Any]] = []
        self._warnings: list[UserFault] = []
        self._rewards: list[float | None] = []
        self._call_ms: list[float] = []

    def answer(self) -> dict[str, Any]:
        """What came of it."""
        self._try()
        hints = [_told(warning, None) for warning in self._warnings]
        return {"faults": self._faults, "warnings": hints, "rewards": self._rewards}

    def _try(self) -> None:
        if self._check:
            self._faults = [_told(fault, None) for fault in check_text(self._code)]
            if self._faults:
                return
            self._warnings = hints_of(self._code)
            self._began = time.process_time()
        try:
            reward = load_reward(self._code)
        except UserFault as fault:
            self._faults = [_told(fault, None)]
            return
        load_ms = 1000.0 * (time.process_time() - self._began)
        first = self._first_step(reward) if self._whole and self._states else None
        if first is not None and first.code in _EXPENSIVE:
            self._note(first, 0)
            return
        for number, params in enumerate(self._states):
            try:
                self._rewards.append(self._call(reward, params))
            except UserFault as fault:
                if self._out_of_time(fault):
                    break
                self._rewards.append(None)
                self._note(fault, number)
                if fault.code in _EXPENSIVE or not self._check:
                    break
        else:
            self._warnings += slowness(self._call_ms, load_ms)
        if first is not None:
            self._note(first, 0)

    def _call(self, reward: Reward, params: Params) -> float:
        # All calls together have the time of one.
        began = time.process_time()
        watch.watch.limit_s = watch.LIMIT_S - (began - self._began)
        try:
            return reward(params)
        finally:
            self._call_ms.append(1000.0 * (time.process_time() - began))

    def _first_step(self, reward: Reward) -> UserFault | None:
        """What keeps something of an episode's first step may look for ``steps`` 1. Prints are not kept."""
        watch.watch.muted = True
        try:
            with warnings.catch_warnings(action="ignore"):  # each line warns once: in the first state that counts
                self._call(reward, {**self._states[0], "steps": 1})
        except UserFault as fault:
            return fault
        finally:
            watch.watch.muted = False
        return None

    def _note(self, fault: UserFault, state: int) -> None:
        """Keep a fault, if no other state had it."""
        told = _told(fault, state)
        if all((told["code"], told["params"]) != (other["code"], other["params"]) for other in self._faults):
            self._faults.append(told)

    def _out_of_time(self, fault: UserFault) -> bool:
        """Whether many calls together took the time of one, and may leave the rest out; then that is a warning."""
        *before, last = self._call_ms
        if self._whole or fault.code != "reward_too_slow" or not before or last >= 1000.0 * watch.LIMIT_S / 2:
            return False
        mean = round(sum(before) / len(before), 1)
        total = len(self._states)
        self._warnings.append(UserFault("reward_slow_in_all", ms=str(mean), count=len(before), total=total))
        return True


def _told(fault: UserFault, state: int | None) -> dict[str, Any]:
    return {"code": fault.code, "params": fault.params, "state": state}
