"""Drives many laps of one car in one pair of sandboxed processes: the chunks of a car's report. No Django."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from paddock.errors import PlatformFault
from paddock.network.bound import FactsDocument, NetworkFacts
from paddock.network.policy_wire import EXCEEDED, WAYS
from paddock.packages.metadata import MetadataDocument
from paddock.rules.race import RaceRules
from paddock.rules.report import LAP
from paddock.simulator.randomisation import Variation

from ..sandbox.cores import one_core
from .messages import RunProgress
from .pipeline import WALL_LIMIT_S, PolicyBudget, RivalModel, SandboxedRun
from .process_pool import DRIVES_MODULE, ProcessPool
from .race_setup import Venue


@dataclass(frozen=True)
class LapDrive:
    """One lap. ``number``: the caller's; ``variation``: what is other than usual in it, None for nothing."""

    number: int
    venue: Venue
    variation: Variation | None = None


@dataclass(frozen=True)
class DriveJob:
    """Which car drives which laps; ``onnx``, ``metadata`` and ``facts`` as in :class:`.pipeline.RaceJob`."""

    onnx: bytes
    metadata: MetadataDocument
    facts: FactsDocument | None
    drives: tuple[LapDrive, ...]
    rules: RaceRules = LAP


@dataclass(frozen=True)
class DriveOutcome:
    """The outcome of one lap. ``time_ms``: of the lap, or until it ended; ``percent``: of the lap; ``status``: how it
    ended, in the words of sim-traces; ``x``, ``y``: where, in metres."""

    number: int
    complete: bool
    time_ms: int
    percent: float
    end_reason: str
    status: str
    x: float
    y: float
    trace_sha256: str


@dataclass(frozen=True)
class DrivesOutcome:
    """What came of a job. ``inexact``: the bound of the network did not hold; all was driven again without it."""

    drives: list[DriveOutcome]
    engine: str
    versions: dict[str, str]
    inexact: bool
    wall_s: float


def drive_all(
    job: DriveJob,
    on_progress: Callable[[int], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    wall_limit_s: float = WALL_LIMIT_S,
    *,
    level: int | None = None,
) -> DrivesOutcome:
    """Drive the laps, one after the other. ``on_progress`` gets how many are done; else as
    :func:`evaluation.running.pipeline.evaluate`."""
    outcome, exceeded = _driven(job, on_progress, should_stop, wall_limit_s, level)
    if not exceeded:
        return outcome
    exact = replace(job, facts=NetworkFacts(bound=None).to_dict())
    outcome, _ = _driven(exact, on_progress, should_stop, wall_limit_s, level)
    return replace(outcome, inexact=True)


def _driven(
    job: DriveJob,
    on_progress: Callable[[int], None] | None,
    should_stop: Callable[[], bool],
    wall_limit_s: float,
    level: int | None,
) -> tuple[DrivesOutcome, bool]:
    started = time.monotonic()
    venues = list(dict.fromkeys(drive.venue for drive in job.drives))
    message = {
        "rules": job.rules.to_dict(),
        "budget": asdict(PolicyBudget()),
        "venues": [venue.to_dict() for venue in venues],
        "drives": [
            {
                "venue": venues.index(drive.venue),
                "variation": None if drive.variation is None else asdict(drive.variation),
            }
            for drive in job.drives
        ],
    }

    def report(progress: RunProgress) -> None:
        if on_progress is not None:
            on_progress(int(progress["done"]))

    with ProcessPool(1, level, module=DRIVES_MODULE) as pool:
        pool.runner.allow(wall_limit_s * len(job.drives))
        run = SandboxedRun(pool, report, should_stop)
        run.prepare([RivalModel(job.onnx, job.metadata, job.facts)], message)
        with one_core([process.inner_pid for process in run.processes.values()]):
            answer, _ = run.drive()
        try:
            result = answer["result"]
            ways = dict(zip(WAYS, result["ways"], strict=True))
            drives = [
                DriveOutcome(number=drive.number, **driven)
                for drive, driven in zip(job.drives, result["drives"], strict=True)
            ]
            outcome = DrivesOutcome(drives, result["engine"], result["versions"], False, time.monotonic() - started)
        except (KeyError, TypeError, ValueError) as error:
            raise run.noted(PlatformFault("runner_protocol")) from error
    return outcome, bool(ways[EXCEEDED])
