"""What a reward function pays for: its rewards on the eight drives, their ranks, and findings in plain sentences."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, combinations

from paddock.errors import UserFault

from ..laboratory.heat_map import number
from ..sandbox.client import ask
from ..sandbox.function import name_state
from ..sandbox.static_checks import MAX_CHARACTERS
from ..validation import Problem
from .drives import CIRCLES, CRASH, FAST, SLOW, STANDING, RecordedDrive

GOOD, BAD, NOTE = "good", "bad", "note"
MOST_DISCOUNT = 0.9999
_ALIKE = 0.02  # share of the greater value by which two values may differ and count as equal
_CONNECTED = 0.25  # a rank correlation from here on is one
_FEWEST = 3  # drives that it takes
_PROGRESS = ("reward_ignores_progress", "reward_follows_progress", "reward_against_progress")
_LAPS = ("reward_ignores_laps", "reward_follows_laps", "reward_against_laps")


@dataclass(frozen=True)
class AuditRow:
    """One drive and its rewards. ``reached``: whether its last step was; if not, the time was used up before, and its
    figures are 0. ``rewards``: of each step, 0 where it ``failed``. ``total``: their sum; ``step``: their mean;
    ``worth``: see :func:`worth_of`. ``by_reward`` and ``by_time``: ranks from 1, equal ones the same."""

    drive: RecordedDrive
    reached: bool = False
    rewards: tuple[float, ...] = ()
    failed: int = 0
    total: float = 0.0
    step: float = 0.0
    worth: float = 0.0
    by_reward: int = 0
    by_time: int = 0


@dataclass(frozen=True)
class AuditFinding:
    """``verdict``: "good", "bad" or "note"; ``code``: a reason code, ``params`` its details."""

    verdict: str
    fault: UserFault


@dataclass(frozen=True)
class AuditFailure:
    """A problem that came in ``count`` steps, first in ``step`` (from 1) of a drive; None outside of the drives."""

    problem: Problem
    count: int = 1
    drive: str | None = None
    step: int | None = None


@dataclass(frozen=True)
class RewardAudit:
    """``rows``: one for each drive, empty if the function could not start. ``progress`` and ``lap_time``: rank
    correlations of the worth with progress a second and with the lap time, None where it is the same everywhere."""

    rows: list[AuditRow]
    findings: list[AuditFinding]
    failures: list[AuditFailure]
    warnings: list[Problem]
    printed: str
    progress: float | None = None
    lap_time: float | None = None


def audit_reward(
    code: str, drives: Sequence[RecordedDrive], *, discount: float = 0.97, level: int | None = None
) -> RewardAudit:
    """Ask the function at each step of the drives, 5 s of computing in all. ``discount``: of the training.

    Raises as :func:`training.rewards.validation.check_reward`.
    """
    if not 1 <= len(code) <= MAX_CHARACTERS:
        fault = UserFault("reward_length", length=len(code), limit=MAX_CHARACTERS)
        return RewardAudit([], [], [AuditFailure(Problem.of(fault))], [], "")
    states = [state for drive in drives for state in drive.states]
    begins = [0, *accumulate(len(drive.states) for drive in drives)]
    answer = ask(code, states, check=True, drives=begins[:-1], level=level)
    failures = []
    for (fault, state), count in zip(answer.faults, answer.counts or [1] * len(answer.faults), strict=True):
        if state is None:
            failures.append(AuditFailure(Problem.of(fault), count))
            continue
        name_state(fault, states[state])
        number = max(at for at, begin in enumerate(begins[:-1]) if begin <= state)
        failures.append(AuditFailure(Problem.of(fault), count, drives[number].name, state - begins[number] + 1))
    named = {fault.params.get("name") for fault, _ in answer.faults if fault.code == "reward_param_unknown"}
    warnings = [Problem.of(one) for one in answer.warnings if one.params.get("name", "") not in named]
    audit = RewardAudit([], [], failures, warnings, answer.printed)
    if not answer.rewards:
        return audit
    rows = [
        _row(drive, answer.rewards[begin : begin + len(drive.states)], discount)
        for drive, begin in zip(drives, begins, strict=False)
    ]
    return _judged(replace(audit, rows=_ranked(rows)))


def worth_of(rewards: Sequence[float], discount: float) -> float:
    """What a training raises, as a reward for each step: the discounted sum of the rewards from a step to the end of
    the episode, times 1 - discount, as the mean over all steps. A constant reward of 1 comes close to 1 in a drive that
    is long for the discount, and less in one that ends early."""
    discount = min(discount, MOST_DISCOUNT)
    later = total = 0.0
    for reward in reversed(rewards):
        later = reward + discount * later
        total += later
    return (1.0 - discount) * total / len(rewards)


def _row(drive: RecordedDrive, rewards: Sequence[float | None], discount: float) -> AuditRow:
    if len(rewards) < len(drive.states):
        return AuditRow(drive)
    known = [reward or 0.0 for reward in rewards]
    total = sum(known)
    return AuditRow(
        drive, True, tuple(known), rewards.count(None), total, total / len(known), worth_of(known, discount)
    )


def _ranked(rows: Sequence[AuditRow]) -> list[AuditRow]:
    known = [row.worth for row in rows if row.reached]
    times = [_time(row.drive) for row in rows]
    return [
        replace(
            row,
            by_reward=1 + sum(other > row.worth for other in known) if row.reached else 0,
            by_time=1 + sum(other < time for other in times),
        )
        for row, time in zip(rows, times, strict=True)
    ]


def _time(drive: RecordedDrive) -> tuple[bool, float]:
    """The order of a race: laps by their times, then the others by how far they came."""
    return (True, -drive.progress) if drive.lap_ms is None else (False, drive.lap_ms)


def _judged(audit: RewardAudit) -> RewardAudit:
    rows = [row for row in audit.rows if row.reached]
    laps = [row for row in rows if row.drive.lap_ms is not None]
    progress = correlation([row.worth for row in rows], [row.drive.progress_per_second for row in rows])
    lap_time = correlation([row.worth for row in laps], [float(row.drive.lap_ms or 0) for row in laps])
    findings = [
        *_speed(rows),
        *_connection(_PROGRESS, rows, progress, 1),
        *_connection(_LAPS, laps, lap_time, -1),
        *_order(rows),
        *_traps(rows),
    ]
    failed, total = sum(row.failed for row in audit.rows), sum(len(row.drive.states) for row in audit.rows)
    if failed:
        findings.insert(0, AuditFinding(BAD, UserFault("reward_steps_failed", count=failed, total=total)))
    return replace(audit, findings=findings, progress=progress, lap_time=lap_time)


def correlation(ours: Sequence[float], theirs: Sequence[float]) -> float | None:
    """Spearman's rank correlation, -1 to 1; None where all values of one side are equal."""
    a, b = _ranks(ours), _ranks(theirs)
    if len(a) < _FEWEST or len(set(a)) == 1 or len(set(b)) == 1:
        return None
    return statistics.correlation(a, b)


def _ranks(values: Sequence[float]) -> list[float]:
    """Ranks from 1; equal values, and those that differ by rounding, share the mean of their ranks."""
    size = max(map(abs, values), default=0.0) or 1.0
    rounded = [round(value / size, 9) for value in values]
    return [1 + sum(other < value for other in rounded) + (rounded.count(value) - 1) / 2 for value in rounded]


def _are_alike(one: float, other: float) -> bool:
    return abs(one - other) <= _ALIKE * max(abs(one), abs(other))


def _is_more(one: float, other: float) -> bool:
    return one > other and not _are_alike(one, other)


def _speed(rows: Sequence[AuditRow]) -> list[AuditFinding]:
    named = {row.drive.name: row.worth for row in rows}
    if FAST not in named or SLOW not in named:
        return []
    fast, slow = named[FAST], named[SLOW]
    verdict, code = (GOOD, "reward_pays_fast") if fast > slow else (BAD, "reward_pays_slow")
    if _are_alike(fast, slow):
        verdict, code = NOTE, "reward_pays_alike"
    return [AuditFinding(verdict, UserFault(code, fast=number(fast), slow=number(slow)))]


def _connection(codes: Sequence[str], rows: Sequence[AuditRow], value: float | None, wanted: int) -> list[AuditFinding]:
    """``wanted``: the sign of a good correlation."""
    if len(rows) < _FEWEST:
        return []
    kind = 0 if value is None or abs(value) < _CONNECTED else 1 if value * wanted > 0 else 2
    shown = f"{value or 0.0:+.2f}".replace("-", "\N{MINUS SIGN}")
    return [AuditFinding((NOTE, GOOD, BAD)[kind], UserFault(codes[kind], value=shown))]


def _order(rows: Sequence[AuditRow]) -> list[AuditFinding]:
    pairs = list(combinations(rows, 2))
    if not pairs:
        return []
    same = sum(
        (_time(a.drive) < _time(b.drive)) == (a.worth > b.worth) and not _are_alike(a.worth, b.worth) for a, b in pairs
    )
    share = same / len(pairs)
    verdict = GOOD if share >= 0.7 else BAD if share < 0.5 else NOTE
    return [AuditFinding(verdict, UserFault("reward_order", same=same, all=len(pairs)))]


def _step_until(row: AuditRow, progress: float) -> float:
    """The mean reward of the steps up to this progress."""
    pairs = zip(row.rewards, row.drive.states, strict=True)
    rewards = [reward for reward, state in pairs if state["progress"] <= progress]
    return sum(rewards) / len(rewards) if rewards else row.step


def _traps(rows: Sequence[AuditRow]) -> list[AuditFinding]:
    named = {row.drive.name: row for row in rows}
    fast = named.get(FAST)
    if fast is None:
        return []
    found = []
    for name, code in ((STANDING, "reward_standing_pays"), (CRASH, "reward_crash_pays")):
        # by both: a sum alone pays long drives, the worth alone those that stay where a potential is low
        if name in named and named[name].total > fast.total and _is_more(named[name].worth, fast.worth):
            found.append(AuditFinding(BAD, UserFault(code, value=number(named[name].worth), lap=number(fast.worth))))
    if CIRCLES in named:
        circles = named[CIRCLES]
        value = circles.step
        # of whole laps, and of their beginnings, as some functions pay less there
        step = max(max(row.step, _step_until(row, circles.drive.progress)) for row in (fast, named.get(SLOW, fast)))
        if _is_more(value, step):
            found.append(AuditFinding(BAD, UserFault("reward_circles_pay", value=number(value), lap=number(step))))
    if not found and all(
        name in named and _is_more(fast.worth, named[name].worth) for name in (STANDING, CRASH, CIRCLES)
    ):
        found.append(AuditFinding(GOOD, UserFault("reward_no_traps")))
    return found
