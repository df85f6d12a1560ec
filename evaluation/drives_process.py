"""The referee of many laps of one car, one after the other, in a sandboxed process like that of a race.

Used by :func:`evaluation.drives.drive_all`. It reads a message with the job, answers ``{"headers": [...]}``, waits for
the start, sends ``{"progress": {"done"}}`` after each lap, and then one ``{"result": ...}`` or one ``{"error": ...}``.

Every lap is a race of its own, in a fresh world, with the whole budget of time for its network: its result is the same
whatever is driven before it and after.
"""

from __future__ import annotations

import contextlib
import dataclasses
from typing import Any

from paddock.network.policy_wire import WAYS
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.engine import ENGINE_ID, versions
from paddock.simulator.race import Progress, run_race
from paddock.simulator.sensors import policy_header
from paddock.simulator.stage import PreparedTrack
from paddock.simulator.variations import Variation

from .runner_process import ground_of, policy_client, policy_of, telling_faults
from .sandbox.frames import FrameError, read_message, write_message
from .sandbox.policy_client import PolicyClient

_NEVER = 1 << 30  # steps: progress is told at the end of a lap alone


def main(frames_in: int, frames_out: int) -> None:
    """Run one job; see the module."""
    telling_faults(_drive_all, frames_in, frames_out)


def _drive_all(frames_in: int, frames_out: int) -> None:
    job, _ = read_message(frames_in)
    (metadata,) = job["metadata"]
    space = ActionSpace.from_metadata(metadata)
    header = policy_header(metadata, space)
    write_message(frames_out, {"headers": [header]})
    rules = RaceRules.from_dict(job["rules"])
    read_message(frames_in)
    ground, built = None, -1  # one at a time: a large track takes 30 MB
    driven: list[dict[str, Any]] = []
    ways = dict.fromkeys(WAYS, 0)
    for drive in job["drives"]:
        if ground is None or drive["venue"] != built:
            ground, built = ground_of(job["venues"][drive["venue"]]), drive["venue"]
        client = policy_client(0, header, job["budget"])
        driven.append(_driven(ground, rules, drive["variation"], metadata, space, client))
        for way, count in client.counts.items():
            ways[way] += count
        write_message(frames_out, {"progress": {"done": len(driven)}})
    said = {"drives": driven, "engine": ENGINE_ID, "versions": versions(), "ways": [ways[way] for way in WAYS]}
    write_message(frames_out, {"result": said})
    with contextlib.suppress(FrameError):  # with this process the policy would end, and nobody could measure it
        read_message(frames_in)


def _driven(
    ground: PreparedTrack,
    rules: RaceRules,
    told: dict[str, Any] | None,
    metadata: dict[str, Any],
    space: ActionSpace,
    client: PolicyClient,
) -> dict[str, Any]:
    """One lap; the fields of :class:`evaluation.drives.DriveOutcome` but for its number."""
    variation = None if told is None else Variation(**told)
    last: list[Progress] = []
    result = run_race(
        ground.track,
        dataclasses.replace(
            rules, direction=ground.track.direction, start_m=0.0 if variation is None else variation.start_m
        ),
        space,
        sorted(metadata["sensor"]),
        policy_of(client, space),
        on_progress=last.append,
        progress_every_steps=_NEVER,
        lidar_config=metadata.get("lidar_config"),
        ground=ground,
        places=client.places,
        disturbance=None if variation is None else variation.disturbance(ground.theme),
    )
    lap, at = result.laps[0], last[-1]
    return {
        "complete": lap.complete,
        "time_ms": lap.time_ms,
        "percent": 100.0 if lap.complete else min(max(at.percent, 0.0), 99.99),
        "end_reason": result.end_reason,
        "status": lap.status,
        "x": at.x,
        "y": at.y,
        "trace_sha256": result.trace.sha256,
    }
