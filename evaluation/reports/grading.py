"""Grades a report: laps by track, the car's robustness, and a hash over it all.

Robustness is a grade from A to E (:data:`GRADES`) from the share of the hundred variations that were completed, and
from the *spread*: the time between the 90th and the 10th percentile of completed laps, as a share of the median. All
numbers are whole, and so the same for the same laps.
"""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from paddock.rules.report import KINDS, kind_of, percent_of

HASH_FORM = "paddock-report-1"


@dataclass(frozen=True)
class Grade:
    """``least``: per cent of the variations that must be completed; ``most``: per mille of the spread at most, None for
    any."""

    name: str
    least: int
    most: int | None


GRADES = (Grade("A", 95, 200), Grade("B", 85, 300), Grade("C", 65, 500), Grade("D", 40, None), Grade("E", 0, None))


@dataclass(frozen=True)
class DrivenLap:
    """A lap as it came out. ``variation``: its number, None for a lap as it is; the rest as in
    :class:`evaluation.running.drives.DriveOutcome`. ``track``: its fingerprint."""

    number: int
    track: str
    direction: str
    variation: int | None
    complete: bool
    time_ms: int
    percent: float
    trace_sha256: str


@dataclass(frozen=True)
class KindSummary:
    """One kind of variation, or all of them. ``copes_percent``: up to which strength it completed every one; spread and
    times: of the completed ones, None without."""

    kind: str
    driven: int
    completed: int
    copes_percent: int
    best_ms: int | None
    median_ms: int | None
    spread_permille: int | None

    @property
    def share(self) -> int:
        return 100 * self.completed // self.driven if self.driven else 0


@dataclass(frozen=True)
class Robustness:
    grade: str
    overall: KindSummary
    kinds: list[KindSummary]


def robustness_of(laps: Sequence[DrivenLap]) -> Robustness | None:
    """The robustness of varied laps; None where there are none."""
    varied = sorted((lap for lap in laps if lap.variation is not None), key=lambda lap: lap.variation or 0)
    if not varied:
        return None
    overall = _summary("", varied)
    kinds = [_summary(kind, [lap for lap in varied if kind_of(lap.variation or 0) == kind]) for kind in KINDS]
    return Robustness(grade_of(overall), overall, kinds)


def grade_of(overall: KindSummary) -> str:
    """The best grade whose both bounds are kept."""
    spread = overall.spread_permille
    for grade in GRADES:
        if overall.completed * 100 >= grade.least * overall.driven and (
            grade.most is None or (spread is not None and spread <= grade.most)
        ):
            return grade.name
    raise AssertionError("the last grade asks for nothing")


def _summary(kind: str, laps: Sequence[DrivenLap]) -> KindSummary:
    times = sorted(lap.time_ms for lap in laps if lap.complete)
    copes = 0
    if kind:
        for lap in laps:
            if not lap.complete:
                break
            copes = percent_of(lap.variation or 0)
    median = _rank(times, 50)
    return KindSummary(
        kind=kind,
        driven=len(laps),
        completed=len(times),
        copes_percent=copes,
        best_ms=times[0] if times else None,
        median_ms=median,
        spread_permille=1000 * ((_rank(times, 90) or 0) - (_rank(times, 10) or 0)) // median if median else None,
    )


def _rank(times: Sequence[int], percent: int) -> int | None:
    """The time that so many per cent do not exceed (nearest rank), of sorted ones."""
    return times[max(math.ceil(len(times) * percent / 100), 1) - 1] if times else None


def digest_of(*, network: str, seed: int, engine: str, laps: Iterable[DrivenLap]) -> str:
    """The sha-256 over a report: one line on the car, seed and engine, and one for each lap in the order of numbers.
    The same model, tracks, seed and engine give the same on every worker."""
    lines = [f"{HASH_FORM} {network} {seed} {engine}"]
    for lap in sorted(laps, key=lambda lap: lap.number):
        variation = "-" if lap.variation is None else lap.variation
        result = f"{int(lap.complete)} {lap.time_ms} {lap.trace_sha256}"
        lines.append(f"{lap.number} {lap.track} {lap.direction} {variation} {result}")
    return hashlib.sha256("\n".join([*lines, ""]).encode()).hexdigest()
