"""The referee of many laps of one car, in a sandboxed process like that of a race (:func:`.drives.drive_all`).

It answers the job with ``{"headers": [...]}``, waits for the start, sends ``{"progress": {"done"}}`` after each lap,
and then ``{"result": ...}`` or ``{"error": ...}``. Every lap is a race in a fresh world, with the whole time budget for
its network.
"""

import contextlib
import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from paddock.network.policy_wire import WAYS
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.engine import ENGINE_ID, versions
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.randomisation import Variation
from paddock.simulator.results import Progress
from paddock.simulator.sensors import policy_header
from paddock.simulator.stage import PreparedTrack

from ..sandbox.frames import FrameError, read_message, write_message
from ..sandbox.policy_client import PolicyClient
from .messages import DriveDocument
from .runner_process import ground_of, policy_client, policy_of, telling_faults

if TYPE_CHECKING:
    from paddock.packages.metadata import MetadataDocument

_NEVER = 1 << 30  # steps: progress is reported only at the end of a lap


def main(frames_in: int, frames_out: int) -> None:
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
    driven: list[DriveDocument] = []
    ways = dict.fromkeys(WAYS, 0)
    for drive in job["drives"]:
        if ground is None or drive["venue"] != built:
            ground, built = ground_of(job["venues"][drive["venue"]]), drive["venue"]
        client = policy_client(0, header, job["budget"])
        driven.append(_driven(ground, rules, drive["variation"], metadata, space, client))
        for way, count in client.counts.items():
            ways[way] += count
        write_message(frames_out, {"progress": {"done": len(driven)}})
    result = {"drives": driven, "engine": ENGINE_ID, "versions": versions(), "ways": [ways[way] for way in WAYS]}
    write_message(frames_out, {"result": result})
    with contextlib.suppress(FrameError):  # with this process the policy would end, and nobody could measure it
        read_message(frames_in)


def _driven(
    ground: PreparedTrack,
    rules: RaceRules,
    fields: Mapping[str, Any] | None,
    metadata: "MetadataDocument",
    space: ActionSpace,
    client: PolicyClient,
) -> DriveDocument:
    variation = None if fields is None else Variation(**fields)
    last: list[Progress] = []
    start_m = 0.0 if variation is None else variation.start_m
    car = Entrant(
        space, sorted(metadata["sensor"]), policy_of(client, space), metadata.get("lidar_config"), client.places, client
    )
    settings = RaceSettings(
        ground.track,
        dataclasses.replace(rules, direction=ground.track.direction, start_m=start_m),
        [car],
        on_progress=last.append,
        progress_every_steps=_NEVER,
        ground=ground,
        disturbance=None if variation is None else variation.disturbance(ground.theme),
    )
    result = run_race(settings)
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
