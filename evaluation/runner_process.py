"""The referee in its own walled-off process: simulator and rules, no secrets, no network, no file.

Started by :mod:`.pipeline`. It reads a message with the job, answers ``{"header": ...}`` (what it will ask the policy,
see :mod:`evaluation.sandbox.policy_wire`), builds the world, waits for ``{"start": true}`` before it asks the policy
for the first time, drives, and sends ``{"progress": ...}`` messages and then one ``{"result": ...}`` with the trace,
or one ``{"error": {"code", "fault", "params"}}``.

``sys.argv[1:]``: the descriptors on which it reads from and writes to the policy.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.random  # numpy loads it at first use, which would be after the lock

from faults import PaddockError
from tracks.geometry import TrackGeometry

from .sandbox.frames import read_message, write_message
from .sandbox.policy_client import PolicyClient
from .simulator.action import ActionSpace
from .simulator.engine import versions
from .simulator.metrics import metrics_json
from .simulator.race import run_race
from .simulator.rules import RaceRules
from .simulator.sensors import SENSORS

cv2.setNumThreads(1)
versions()  # reads package metadata from files, once


def main(frames_in: int, frames_out: int) -> None:
    """Run one job; see the module."""
    try:
        _run(frames_in, frames_out)
    except PaddockError as fault:
        write_message(frames_out, {"error": fault.to_dict()})
    except MemoryError:
        raise
    except Exception as error:
        traceback.print_exc()  # for operators, on stderr
        detail = f"{type(error).__name__}: {error}"[:500]
        write_message(frames_out, {"error": {"code": "runner_error", "params": {"detail": detail}}})


def _run(frames_in: int, frames_out: int) -> None:
    job, _ = read_message(frames_in)
    track = TrackGeometry.from_trusted_dict(job["track"])  # the worker sent it
    rules = RaceRules.from_dict(job["rules"])
    space = ActionSpace.from_metadata(job["metadata"])
    sensors = sorted(job["metadata"]["sensor"])
    header = policy_header(sensors, space)
    write_message(frames_out, {"header": header})
    policy = PolicyClient(int(sys.argv[1]), int(sys.argv[2]), header, **job["budget"])
    result = run_race(
        track,
        rules,
        space,
        sensors,
        _after_the_start(policy, frames_in),
        on_progress=lambda progress: write_message(frames_out, {"progress": progress.to_dict()}),
    )
    seconds = {**result.seconds, "policy": policy.seconds}  # without the wait for the start
    write_message(frames_out, {"result": _outcome(result), "seconds": seconds}, [result.trace.to_csv()])
    os.read(frames_in, 1)  # stay to be measured until the pipeline lets go


def _after_the_start(policy: PolicyClient, frames_in: int) -> Callable[[dict[str, np.ndarray]], np.ndarray]:
    """``policy``, asked for the first time when the start message has come: the network may still be loading."""
    started = False

    def ask(readings: dict[str, np.ndarray]) -> np.ndarray:
        nonlocal started
        if not started:
            read_message(frames_in)
            started = True
        return policy(readings)

    return ask


def policy_header(sensors: list[str], space: ActionSpace) -> dict[str, Any]:
    """What the policy must take and answer."""
    specs = [SENSORS[name] for name in sensors]
    inputs = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
    return {"inputs": inputs, "outputs": space.size}


def _outcome(result: Any) -> dict[str, Any]:
    return {
        "laps": [lap.to_dict() for lap in result.laps],
        "end_reason": result.end_reason,
        "simulated_ms": result.simulated_ms,
        "steps": result.steps,
        "trace_sha256": result.trace.sha256,
        "metrics": metrics_json(result),
        "engine": result.engine,
        "versions": result.versions,
    }
