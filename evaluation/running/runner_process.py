"""The referee in its own sandboxed process: simulator and rules, no secrets, no network, no file.

It answers the job with ``{"headers": [...]}`` (see :mod:`paddock.network.policy_wire`), builds the world, waits for
``{"start": true}``, drives, and sends ``{"progress": ...}``, ``{"retired": {"car", "error"}}`` for each retired car,
and then ``{"result": ...}`` with layout and traces, or ``{"error": {"code", "fault", "params"}}``. A message
``{"venues": [...]}`` before the job names tracks to prepare and rehearse on.

``sys.argv[1:]``: for each car the descriptors on which it reads from and writes to its policy, and that of the
:mod:`evaluation.sandbox.observation_memory` (-1 for none).
"""

import contextlib
import json
import select
import sys
import time
import traceback
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from paddock.errors import PaddockError, UserFault
from paddock.geometry.track import TrackGeometry
from paddock.network.policy_wire import WAYS, PolicyHeader
from paddock.rules.race import RaceRules
from paddock.simulator.action import DISCRETE, ActionSpace
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.engine import versions
from paddock.simulator.race import Entrant, Policy, RaceSettings, run_race
from paddock.simulator.results import CompetitorRun, Progress, RaceResult, metrics_json
from paddock.simulator.sensors import policy_header
from paddock.simulator.stage import PreparedTrack
from paddock.simulator.world import make_ready, new_world

from ..sandbox.frames import FrameError, read_message, write_message
from ..sandbox.observation_memory import map_for_writing
from ..sandbox.policy_client import PolicyClient
from .messages import CarDocument, ResultDocument
from .race_setup import VenueDocument

_PROGRESS_S = 0.5
_REHEARSAL_MS = 2000  # simulated

cv2.setNumThreads(1)
versions()  # reads the names of installed packages, once


def main(frames_in: int, frames_out: int) -> None:
    telling_faults(_run, frames_in, frames_out)


def telling_faults(run: Callable[[int, int], None], frames_in: int, frames_out: int) -> None:
    """Run ``run`` and send its faults as the last message."""
    make_ready()  # a process that is kept ready does this before there is a job
    try:
        run(frames_in, frames_out)
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
    venues = job.get("venues", [])
    grounds: list[PreparedTrack] = []
    if venues:
        for venue in venues:
            if select.select([frames_in], [], [], 0)[0]:
                break  # the job has come, and would wait
            grounds.append(_rehearsed(ground_of(venue)))
            make_ready()
        job, _ = read_message(frames_in)
    if "prepared" in job:
        number = job["prepared"]
        ground = grounds[number] if number < len(grounds) else ground_of(venues[number])
    else:
        ground = ground_of(job["venue"])
    rules = RaceRules.from_dict(job["rules"])
    spaces = [ActionSpace.from_metadata(metadata) for metadata in job["metadata"]]
    headers = [policy_header(metadata, space) for metadata, space in zip(job["metadata"], spaces, strict=True)]
    write_message(frames_out, {"headers": headers})
    start = _Start(frames_in)
    clients = [policy_client(number, header, job["budget"]) for number, header in enumerate(headers)]
    for client in clients:
        client.before_first = start.wait
    policies = [policy_of(client, space) for client, space in zip(clients, spaces, strict=True)]
    if len(policies) > 1:
        policies = [_reporting(policy, number, frames_out) for number, policy in enumerate(policies)]
    entrants = [
        Entrant(space, sorted(metadata["sensor"]), policy, metadata.get("lidar_config"), client.places, client)
        for metadata, space, policy, client in zip(job["metadata"], spaces, policies, clients, strict=True)
    ]
    telling = _Telling(frames_out)
    world = new_world()  # never closed: that takes two milliseconds, and it ends with this process
    result = run_race(
        RaceSettings(
            ground.track, rules, entrants, on_progress=telling, progress_due=telling.is_due, ground=ground, world=world
        )
    )
    cars: list[CompetitorRun] = [result, *result.rivals]
    seconds = {**result.seconds, "policy": sum(client.seconds for client in clients)}  # without the wait for the start
    layout = json.dumps(result.layout, allow_nan=False, separators=(",", ":")).encode()
    blobs = [layout, *(car.trace.to_csv() for car in cars)]
    ways = [[client.counts[way] for way in WAYS] for client in clients]
    write_message(frames_out, {"result": _outcome(result, cars), "seconds": seconds, "ways": ways}, blobs)
    with contextlib.suppress(FrameError):  # with this process the policies would end, and nobody could measure them
        read_message(frames_in)


def policy_client(number: int, header: PolicyHeader, budget: dict[str, float]) -> PolicyClient:
    read_fd, write_fd, memory_fd = (int(fd) for fd in sys.argv[1 + 3 * number : 4 + 3 * number])
    return PolicyClient(read_fd, write_fd, header, memory=map_for_writing(memory_fd), **budget)


def policy_of(client: PolicyClient, space: ActionSpace) -> Policy:
    return client.choose if space.kind == DISCRETE else client.ask


def ground_of(venue: VenueDocument) -> PreparedTrack:
    track = TrackGeometry.from_trusted_dict(venue["track"])  # the worker sent it
    return PreparedTrack(track, venue["direction"], THEMES[venue["look"]])


def _rehearsed(ground: PreparedTrack) -> PreparedTrack:
    """``ground`` after a drive on it, straight on: a race on it then finds everything drawn, loaded and warm."""
    rules = RaceRules(max_simulated_ms=_REHEARSAL_MS, direction=ground.track.direction)
    car = Entrant(ActionSpace.discrete([(0.0, 1.0)]), ["FRONT_FACING_CAMERA"], lambda _: np.zeros(1, np.float32))
    run_race(RaceSettings(ground.track, rules, [car], ground=ground)).trace.to_csv()
    return ground


class _Telling:
    """Sends progress at most twice a second: every message takes a third of a millisecond from the race."""

    def __init__(self, frames_out: int) -> None:
        self._frames_out = frames_out
        self._sent = float("-inf")

    def is_due(self) -> bool:
        return time.monotonic() - self._sent >= _PROGRESS_S

    def __call__(self, progress: Progress) -> None:
        self._sent = time.monotonic()
        write_message(self._frames_out, {"progress": progress.to_dict()})


class _Start:
    """The start message; until it comes, the networks may still be loading."""

    def __init__(self, frames_in: int) -> None:
        self._frames_in = frames_in
        self._come = False

    def wait(self) -> None:
        if not self._come:
            read_message(self._frames_in)
            self._come = True


def _reporting(policy: Policy, number: int, frames_out: int) -> Policy:
    """``policy`` of car ``number``, whose faults are sent to the pipeline at once."""

    def ask(readings: dict[str, np.ndarray]) -> np.ndarray | list[float] | int:
        try:
            return policy(readings)
        except UserFault as fault:
            write_message(frames_out, {"retired": {"car": number, "error": fault.to_dict()}})
            raise

    return ask


def _outcome(result: RaceResult, cars: Sequence[RaceResult | CompetitorRun]) -> ResultDocument:
    return {
        "cars": [
            CarDocument(
                laps=[lap.to_dict() for lap in car.laps],
                end_reason=car.end_reason,
                retired=car.retired,
                trace_sha256=car.trace.sha256,
                metrics=metrics_json(car),
            )
            for car in cars
        ],
        "order": result.order,
        "simulated_ms": max(car.simulated_ms for car in cars),
        "steps": max(car.steps for car in cars),
        "engine": result.engine,
        "versions": result.versions,
    }
