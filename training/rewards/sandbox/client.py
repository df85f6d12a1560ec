"""Runs one reward function on a list of states, in a new sandboxed process for each call.

The answer is untrusted like the code: a reward function could forge it, which would mislead its author only.
"""

import contextlib
import os
import re
import select
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from evaluation.sandbox.claims import default_directory
from evaluation.sandbox.frames import FrameClosed, FrameError, FrameTimeout, read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import REWARD
from evaluation.sandbox.lock import EXIT_MEMORY
from evaluation.sandbox.process import FROM_OUTSIDE, SandboxedProcess, widen_pipe
from evaluation.sandbox.slots import upload_slot
from paddock.errors import PlatformFault, UserFault

from ..reasons import REWARD_REASONS, REWARD_WARNINGS
from .allowed_modules import wanted_modules
from .call_limits import KEPT_CHARACTERS, LIMIT_S, line_in
from .function import MAX_REWARD, Params, printable, readable, to_wire

MODULE = "training.rewards.sandbox.process"
SLOTS, WAITING = 2, 1  # with the slots and seats of uploads fewer than the web server has threads
_SLOT_WAIT_S = 20.0
_JSON_LIMIT = 1024 * 1024
_MOST = 64
_GREATEST = 10**6  # no line or length is larger
_KNOWN = REWARD_REASONS | REWARD_WARNINGS
_PARAMETERS = frozenset(re.findall(r"%\((\w+)\)", " ".join(reason.sentence for reason in _KNOWN.values())))


@dataclass(frozen=True)
class Answer:
    """``faults``: with the number of the state, None before any. ``rewards``: one for each state reached, None if it
    failed. ``printed``: the beginning of the output. ``counts``: of an audit, in how many states each fault came."""

    faults: list[tuple[UserFault, int | None]] = field(default_factory=list)
    warnings: list[UserFault] = field(default_factory=list)
    rewards: list[float | None] = field(default_factory=list)
    printed: str = ""
    counts: list[int] = field(default_factory=list)


def ask(
    code: str,
    states: Sequence[Params],
    *,
    check: bool,
    whole: bool = False,
    drives: Sequence[int] = (),
    level: int | None = None,
) -> Answer:
    """Try ``code`` on ``states`` (of one track) in the sandbox; see :mod:`.process` for ``check``, ``whole`` and
    ``drives``.

    A fault of the code is in the answer. Raises PlatformFault (``reward_check_failed``, ``reward_check_busy``, those of
    the sandbox). Leaves no process behind. ``level``: as for :func:`evaluation.sandbox.launch.launch`.
    """
    with _slot(), launch(MODULE, limits=REWARD, arguments=wanted_modules(code), level=level) as process:
        widen_pipe(process.stdin)
        _wait_for_lock(process)
        question = {"code": code, "check": check, "whole": whole, "drives": list(drives), **to_wire(states)}
        computed = 0.0
        try:
            write_message(process.stdin, question, deadline=process.deadline)
            computed = _wait_for_answer(process)
            header, _ = read_message(process.stdout, process.deadline, json_limit=_JSON_LIMIT, blob_limit=0)
            return _checked(header, len(states))
        except FrameTimeout:
            fault = _too_long(process)
        except FrameClosed:
            fault = _death(process, computed)
        except (FrameError, ValueError):
            fault = _at("reward_stuck", process.stderr_text(), how="it wrote into the pipe that is not its own")
    return Answer([(fault, None)])


@contextlib.contextmanager
def _slot() -> Iterator[None]:
    """So many at a time on one machine, and a few that wait: endless ones must not take every thread of the site."""
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(upload_slot(SLOTS, _SLOT_WAIT_S, default_directory() / "rewards", waiting=WAITING))
        except PlatformFault:
            raise PlatformFault("reward_check_busy") from None
        yield


def _wait_for_lock(process: SandboxedProcess) -> None:
    """Until the process is locked it has seen nothing of the code: what goes wrong before is our fault."""
    try:
        process.wait_for_lock(process.deadline - time.monotonic())
    except FrameError as error:
        fault = PlatformFault("reward_check_failed")
        fault.add_note(process.stderr_text())
        raise fault from error
    process.allow(REWARD.wall_s)


def _wait_for_answer(process: SandboxedProcess) -> float:
    """Wait for an answer or the end; the processor seconds last seen. Raises FrameTimeout at the deadline, or when the
    process sleeps."""
    poller = select.poll()
    poller.register(process.stdout, select.POLLIN)
    awake, computed = time.monotonic(), 0.0
    while not poller.poll(250):
        now, seconds = time.monotonic(), process.cpu_seconds()
        if seconds > computed or process.wants_processor():
            awake, computed = now, seconds
        if now >= process.deadline or now - awake > LIMIT_S:
            raise FrameTimeout("no answer")
    return computed


def line_of(process: SandboxedProcess, patience_s: float = 1.0) -> int | None:
    """The line of the reward function that a process with :func:`.call_limits.arm` executes now; None without an answer
    in time."""
    before = len(process.stderr_text())
    pid = process.inner_pid
    if pid is None:
        return None
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGUSR1)
        until = time.monotonic() + patience_s
        while time.monotonic() < until:
            line = line_in(process.stderr_text()[before:])
            if line is not None:
                return line
            time.sleep(0.02)
    return None


def _too_long(process: SandboxedProcess) -> UserFault:
    """Out of wall time: the function's fault if it had its processor time, or did not use it. Raises PlatformFault."""
    computes, seconds = process.wants_processor(), process.cpu_seconds()
    if not computes:
        line_of(process)
        return _at("reward_stuck", process.stderr_text(), how="it waited for something")
    if seconds < LIMIT_S:
        raise PlatformFault("reward_check_failed")
    line_of(process)
    return _at("reward_too_slow", process.stderr_text())


def _death(process: SandboxedProcess, computed: float) -> UserFault:
    """The process ended without an answer. The code can set any exit status; only the kernel's signals are trusted.
    Raises PlatformFault."""
    status = process.wait(2.0)
    output = process.stderr_text()
    if status == EXIT_MEMORY:
        return _at("reward_memory", output)
    if status == -signal.SIGXCPU or (status == -signal.SIGKILL and computed >= LIMIT_S):
        return _at("reward_too_slow", output)
    if status in FROM_OUTSIDE:
        fault = PlatformFault("reward_check_failed")
        fault.add_note(output)
        raise fault
    return _at(
        "reward_stuck", output, how="it closed the pipe that is not its own" if status is None else ended_by(status)
    )


def ended_by(status: int) -> str:
    """An exit status of :meth:`SandboxedProcess.wait` in words for the function's author."""
    if status >= 0:
        return "it ended it" if status == 0 else f"exit status {status}"
    try:
        return f"it crashed: {signal.Signals(-status).name}"
    except ValueError:
        return f"it crashed: signal {-status}"


def _at(code: str, stderr: str, **params: str) -> UserFault:
    line = line_in(stderr)
    fault = UserFault(code, **params, **({} if line is None else {"line": line}))
    fault.add_note(stderr)
    return fault


def _checked(header: Mapping[str, object], states: int) -> Answer:
    """The answer, if it has the form of one. Raises ValueError."""
    faults, rewards, printed = header.get("faults"), header.get("rewards"), header.get("printed")
    if not (isinstance(faults, list) and isinstance(rewards, list) and isinstance(printed, str)):
        raise ValueError("not an answer")
    if len(faults) > _MOST or len(rewards) > states or len(printed) > KEPT_CHARACTERS:
        raise ValueError("too much for an answer")
    for reward in rewards:
        if reward is not None and not (type(reward) is float and abs(reward) <= MAX_REWARD):
            raise ValueError("not a reward")
    warnings = header.get("warnings", [])
    if not isinstance(warnings, list) or len(warnings) > _MOST:
        raise ValueError("not warnings")
    hints = [_fault(one, states)[0] for one in warnings]
    found = [_fault(one, states) for one in faults]
    return Answer(found, hints, rewards, readable(printed), [_count(one, states) for one in faults])


def _count(sent: Mapping[str, object], states: int) -> int:
    count = sent.get("count", 1)
    if type(count) is not int or not 1 <= count <= max(states, 1):
        raise ValueError("not a count")
    return count


def _fault(sent: Any, states: int) -> tuple[UserFault, int | None]:
    if not isinstance(sent, dict) or not isinstance(sent.get("code"), str) or not isinstance(sent.get("params"), dict):
        raise ValueError("not a fault")
    if sent["code"] not in _KNOWN:
        raise ValueError("not a code of a reward function")
    state = sent.get("state")
    if state is not None and not (type(state) is int and 0 <= state < states):
        raise ValueError("not a state")
    params: dict[str, str | int] = {}
    for name, value in sent["params"].items():
        if name not in _PARAMETERS:
            raise ValueError("not a parameter's name")
        if type(value) is int and 0 <= value <= _GREATEST:
            params[name] = value
        elif isinstance(value, str):
            params[name] = printable(value)
        else:
            raise ValueError("not a parameter")
    return UserFault(sent["code"], **params), state
