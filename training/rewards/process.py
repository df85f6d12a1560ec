"""In the sandbox: checks one reward function, calls it with the states that it is sent, and answers.

``sys.argv[1:]``: modules to import before the lock (:func:`.modules.wanted_modules`). It says ``{"state": "locked"}``
when it can be asked. Question: ``{"code", "check",
"waypoints", "states"}``. Answer: ``{"faults": [{"code", "params", "state"}], "rewards": [...], "printed"}`` with a
reward (or null) for each state that was come to. ``check``: whether the text is checked first, as for somebody who is
writing it; and all states are tried, where otherwise the first fault is the end.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from evaluation.sandbox.frames import read_message, write_message
from paddock.errors import UserFault

from . import watch
from .check import check_text
from .function import load_reward
from .modules import preload
from .wire import from_wire

_EXPENSIVE = ("reward_too_slow", "reward_memory", "reward_prints_too_much")  # no second one is waited for

watch.arm()
preload(sys.argv[1:])


def main(frames_in: int, frames_out: int) -> None:
    """Answer one question; see the module."""
    write_message(frames_out, {"state": "locked"})
    question, _ = read_message(frames_in)
    found, rewards = _answer(question)
    answer = {"faults": found, "rewards": rewards, "printed": watch.watch.printed}
    write_message(frames_out, answer)


def _answer(question: dict[str, Any]) -> tuple[list[dict[str, Any]], list[float | None]]:
    if question["check"]:
        found = check_text(question["code"])
        if found:
            return [_told(fault, None) for fault in found], []
    began = time.process_time()
    try:
        reward = load_reward(question["code"])
    except UserFault as fault:
        return [_told(fault, None)], []
    faults: list[dict[str, Any]] = []
    rewards: list[float | None] = []
    for number, params in enumerate(from_wire(question)):
        # All calls together have the time of one.
        watch.watch.limit_s = watch.LIMIT_S - (time.process_time() - began)
        try:
            rewards.append(reward(params))
        except UserFault as fault:
            rewards.append(None)
            if all((fault.code, fault.params) != (other["code"], other["params"]) for other in faults):
                faults.append(_told(fault, number))
            if fault.code in _EXPENSIVE or not question["check"]:
                break
    return faults, rewards


def _told(fault: UserFault, state: int | None) -> dict[str, Any]:
    return {"code": fault.code, "params": fault.params, "state": state}
