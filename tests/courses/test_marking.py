"""Marks of 300 made-up students by the rules of two real classes, worked out a second time in another way; late days on
the days when clocks change."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from subprocess import run
from zoneinfo import ZoneInfo

import pytest

from courses.assignments import wording
from courses.marking.calculation import mark
from courses.marking.facts import FIRST_K, AssignmentRules, AttemptFacts, Lap, MarkFacts, PartRules, TrackRun
from courses.marking.lateness import late_days, local_day
from courses.marking.pass_rules import PASS_RULES, Decimal
from tests.factories import lap

ZONE = "Europe/Berlin"
DUE = datetime(2026, 3, 28, 23, 59, tzinfo=ZoneInfo(ZONE)).astimezone(UTC)  # the clocks change in the night after it
STUDENTS = 300
LAPS = {"laps": 5, "clean": True}

# “100 % in 5 consecutive episodes on each of three tracks; then with obstacles; then with bots. Late: 20 points a day”
THREE_STAGES = AssignmentRules(
    due_at=DUE,
    time_zone=ZONE,
    parts=(
        PartRules(1, Decimal(60), "laps_in_row", LAPS, (11, 12, 13)),
        PartRules(2, Decimal(25), "laps_in_row", LAPS, (21,)),
        PartRules(3, Decimal(15), "laps_in_row", LAPS, (31,)),
    ),
    late_points_a_day=Decimal(20),
)
# “the best of the first five graded submissions”, points by the average of three laps
THRESHOLDS = [
    {"at_most_ms": 9_000, "points": "100"},
    {"at_most_ms": 10_000, "points": "87.5"},
    {"at_most_ms": 12_000, "points": "33.33"},
]
FIRST_FIVE = AssignmentRules(
    due_at=DUE,
    time_zone=ZONE,
    parts=(PartRules(1, Decimal(100), "thresholds", {"thresholds": THRESHOLDS, "by": "average", "laps": 3}, (11, 12)),),
    counts=FIRST_K,
    first_k=5,
)


def some_laps(draw: random.Random) -> tuple[Lap, ...]:
    """Seven laps of a car of some skill, some not complete or with a reset."""
    skill, pace = draw.random() ** 0.3, draw.randrange(8_000, 13_000)
    driven = []
    for number in range(1, 8):
        complete, clean = draw.random() < skill, draw.random() < skill
        driven.append(lap(number, pace + draw.randrange(600), complete=complete, resets=0 if clean else 1))
    return tuple(driven)


def some_attempts(draw: random.Random, rules: AssignmentRules) -> list[AttemptFacts]:
    """Up to eight attempts around the deadline; one of ten at its very second. Runs fail or still wait."""
    attempts = []
    for number in range(draw.randrange(9)):
        moment = DUE + timedelta(minutes=draw.randrange(-4000, 6000), seconds=draw.randrange(60))
        runs = {}
        for part in rules.parts:
            for track in part.tracks:
                state = draw.choices(["finished", "failed", "waiting"], [18, 1, 1])[0]
                runs[track] = TrackRun(state, some_laps(draw) if state == "finished" else ())
        attempts.append(AttemptFacts(number, DUE if draw.random() < 0.1 else moment, runs))
    draw.shuffle(attempts)
    return attempts


def by_hand(rules: AssignmentRules, attempts: list[AttemptFacts], points_of: Callable) -> tuple[Fraction, set[int]]:
    """The points, and the attempts that have as many: the earliest of these counts."""
    in_order = sorted(attempts, key=lambda one: (one.accepted_at, one.id))[: rules.first_k]
    worth: dict[int, Fraction] = {}
    for one in in_order:
        here, due = one.accepted_at.astimezone(ZoneInfo(ZONE)), rules.due_at.astimezone(ZoneInfo(ZONE))
        days = (here.date() - due.date()).days + (here.time() > due.time())
        late = Fraction(rules.late_points_a_day) * max(0, days)
        worth[one.id] = max(Fraction(0), sum((points_of(part, one.runs) for part in rules.parts), Fraction(0)) - late)
    most = max(worth.values(), default=Fraction(0))
    first = next((one.id for one in in_order if worth[one.id] == most), None)
    return most, set() if first is None else {first}


def five_in_a_row(part: PartRules, runs: dict[int, TrackRun]) -> Fraction:
    """All points if “ooooo” stands in the laps of every track."""
    written = [
        "".join("o" if one["complete"] and not one["resets"] else "x" for one in runs[t].laps) for t in part.tracks
    ]
    return Fraction(part.points) if all("ooooo" in laps for laps in written) else Fraction(0)


def by_average(part: PartRules, runs: dict[int, TrackRun]) -> Fraction:
    averages = []
    for track in part.tracks:
        sums = []
        for first, second, third in zip(runs[track].laps, runs[track].laps[1:], runs[track].laps[2:], strict=False):
            if first["complete"] and second["complete"] and third["complete"]:
                sums.append(first["time_ms"] + second["time_ms"] + third["time_ms"])
        if not sums:
            return Fraction(0)
        averages.append(min(sums) // 3)
    for limit, points in ((9_000, "100"), (10_000, "87.5"), (12_000, "33.33")):
        if max(averages) <= limit:
            return Fraction(points)
    return Fraction(0)


@pytest.mark.parametrize("rules, points_of", [(THREE_STAGES, five_in_a_row), (FIRST_FIVE, by_average)])
def test_300_students_have_the_marks_that_a_second_calculation_has(rules, points_of):
    draw, seen = random.Random(20260328), []
    for _student in range(STUDENTS):
        attempts = some_attempts(draw, rules)
        found = mark(rules, attempts)
        points, counting = by_hand(rules, attempts, points_of)
        assert Fraction(found.points) == points
        assert {found.attempt} == (counting or {None})
        waits = any(one.state == "waiting" for attempt in _eligible(rules, attempts) for one in attempt.runs.values())
        assert found.is_complete != waits
        seen.append((found.points, found.late_days))
    assert len({points for points, _days in seen}) >= 4, "students of all kinds were made up"
    assert {days for _points, days in seen} >= {0, 1, 2}


def _eligible(rules: AssignmentRules, attempts: list[AttemptFacts]) -> list[AttemptFacts]:
    return sorted(attempts, key=lambda one: (one.accepted_at, one.id))[: rules.first_k]


def attempt(number: int, hours: float, *times: int, waiting: bool = False) -> AttemptFacts:
    laps = tuple(lap(at, time) for at, time in enumerate(times, 1))
    return AttemptFacts(
        number, DUE + timedelta(hours=hours), {11: TrackRun("waiting" if waiting else "finished", laps)}
    )


def one_part(code: str, params: dict, **rules) -> AssignmentRules:
    return AssignmentRules(DUE, ZONE, (PartRules(1, Decimal(10), code, params, (11,)),), **rules)


def why(found: MarkFacts) -> str:
    return found.parts[0].why


def test_the_last_attempt_counts_though_one_before_was_better():
    rules = one_part("best_lap", {"at_most_ms": 9_000}, counts="last")
    found = mark(rules, [attempt(1, -2, 8_000), attempt(2, -1, 9_001)])
    assert (found.attempt, found.points, why(found)) == (2, 0, "too_slow")
    assert mark(rules, [attempt(1, -2, 9_000)]).points == 10


def test_a_mark_waits_for_runs_and_hidden_tracks():
    rules = one_part("best_lap", {"at_most_ms": 9_000})
    found = mark(rules, [attempt(1, -1, waiting=True)])
    assert (found.is_complete, found.parts[0].passed, why(found)) == (False, None, "waits")
    hidden = AssignmentRules(DUE, ZONE, (PartRules(1, Decimal(10), "best_lap", {"at_most_ms": 9_000}, (11,), 1),))
    found = mark(hidden, [attempt(1, -1, 8_000)])
    assert (found.is_complete, found.points, why(found)) == (False, 0, "hidden_waits")
    assert [one.passed for one in found.parts[0].tracks] == [True]
    assert mark(hidden, [attempt(1, -1, 9_500)]).parts[0].passed is False


def test_places_need_the_results_of_all():
    rules = one_part("place", {"place": 2, "by": "best", "laps": 1})
    mine = [attempt(1, -1, 9_000)]
    assert why(mark(rules, mine)) == "place_waits" and not mark(rules, mine).is_complete
    for keys, points, place in (([8_000, 9_000], 10, 2), ([8_000, 8_500, 9_000], 0, 3), ([9_000, 9_000], 10, 1)):
        found = mark(rules, mine, keys={1: keys})
        assert (found.points, found.parts[0].why_params["value"]) == (points, place)


def test_an_extension_moves_the_deadline_of_lateness():
    rules = one_part("best_lap", {"at_most_ms": 9_000}, late_points_a_day=Decimal("2.5"))
    late = [attempt(1, 30, 8_000)]
    assert (mark(rules, late).points, mark(rules, late).late_days) == (Decimal("5.00"), 2)
    assert mark(rules, late, due_at=DUE + timedelta(hours=30)).points == 10
    assert mark(rules, [attempt(1, 24 * 9, 8_000)]).points == 0, "never below nothing"


@pytest.mark.parametrize(
    "zone, due, accepted, days",
    [
        ("Europe/Berlin", "2026-03-28T23:59:00+01:00", "2026-03-28T23:59:00+01:00", 0),
        ("Europe/Berlin", "2026-03-28T23:59:00+01:00", "2026-03-28T23:59:00.000001+01:00", 1),
        ("Europe/Berlin", "2026-03-28T23:59:00+01:00", "2026-03-29T23:59:00+02:00", 1),  # 23 hours
        ("Europe/Berlin", "2026-03-28T23:59:00+01:00", "2026-03-29T23:59:01+02:00", 2),
        ("Europe/Berlin", "2026-10-24T23:59:00+02:00", "2026-10-25T23:59:00+01:00", 1),  # 25 hours
        ("Europe/Berlin", "2026-10-24T23:59:00+02:00", "2026-10-25T23:59:01+01:00", 2),
        ("America/New_York", "2026-03-07T02:30:00-05:00", "2026-03-08T03:30:00-04:00", 1),  # 2:30 is left out
        ("America/New_York", "2026-03-07T02:30:00-05:00", "2026-03-09T02:30:00-04:00", 2),
        ("Asia/Seoul", "2026-03-28T23:59:00+09:00", "2026-03-29T23:59:01+09:00", 2),
        ("Europe/Berlin", "2026-01-01T12:00:00+01:00", "2026-12-31T12:00:00+01:00", 364),
    ],
)
def test_late_days_end_at_the_time_of_day_of_the_deadline(zone, due, accepted, days):
    assert late_days(datetime.fromisoformat(accepted), datetime.fromisoformat(due), zone) == days


@pytest.mark.parametrize(
    "zone, now, hours",
    [
        ("Europe/Berlin", "2026-03-29T12:00:00+02:00", 23),
        ("Europe/Berlin", "2026-10-25T12:00:00+01:00", 25),
        ("America/Santiago", "2026-09-06T12:00:00-03:00", 23),  # midnight is left out
        ("Asia/Seoul", "2026-10-25T12:00:00+09:00", 24),
    ],
)
def test_a_calendar_day_has_its_hours(zone, now, hours):
    begins, ends = local_day(datetime.fromisoformat(now), zone)
    assert begins <= datetime.fromisoformat(now) < ends and ends - begins == timedelta(hours=hours)
    before, _midnight = local_day(begins - timedelta(microseconds=1), zone)
    assert before < begins and local_day(begins, zone)[0] == begins and local_day(ends, zone)[0] == ends


def test_every_rule_takes_its_own_defaults():
    for rule in PASS_RULES.values():
        known = {one.name: one for one in rule.params}
        wrong = {name: known[name].problem(value) for name, value in rule.default_params().items()}
        assert set(wrong.values()) <= {"", "assignment_thresholds"}, rule.code


@pytest.mark.parametrize("value", [0, 21, True, 2.5, "3", None])
def test_a_wrong_value_is_refused(value):
    assert PASS_RULES["laps_in_row"].params[0].problem(value) == "assignment_value"


@pytest.mark.parametrize("value", [[], "x", [{"at_most_ms": 5}], [{"at_most_ms": 5, "points": "NaN"}], [[1, 2]]])
def test_wrong_thresholds_are_refused(value):
    assert PASS_RULES["thresholds"].params[0].problem(value) == "assignment_thresholds"


@pytest.mark.parametrize(
    ("rule", "laps", "says"),
    [
        ("laps_in_row", 2, "2 complete laps in a row on each track."),
        ("laps_in_row", 1, "A complete lap on each track."),
        ("average_lap", 2, "An average of 2 laps in a row of at most 0:09.000 on each track."),
        ("average_lap", 1, "A best lap of at most 0:09.000 on each track."),
        ("best_lap", 1, "A best lap of at most 0:09.000 on each track."),
    ],
)
def test_a_rule_for_one_lap_is_a_sentence(rule, laps, says):
    assert wording.pass_rule_sentence(rule, {"laps": laps, "at_most_ms": 9_000}) == says


def test_too_few_laps_are_told_with_those_needed():
    code, params = PASS_RULES["laps_in_row"].why_not(1, LAPS)
    assert wording.why(code, "laps_in_row", params) == "1 of 5 complete laps in a row."


def test_marking_needs_no_django():
    code = "import courses.marking.calculation, sys; sys.exit('django' in sys.modules)"
    assert run([sys.executable, "-c", code], check=False).returncode == 0
