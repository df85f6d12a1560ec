"""What the audit says of the kinds of reward functions that racers publish agrees with a table made by hand."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from training.rewards.audit.report import audit_reward

from .driven import driven_on_the_oval
from .shapes import SHAPES


class Expected(NamedTuple):
    """``speed``: which lap is worth more. ``progress``: sign of the correlation with progress a second ("?": follows
    from the lines that the drives take, not from the idea of the function). ``traps``: what pays more than a lap.
    ``notes``: codes of problems and warnings."""

    speed: str
    progress: str
    traps: str
    why: str
    notes: str = ""


STAYS = "pays a moment alike at any speed, so that more moments are worth more: the slower lap, and no lap at all"
PLACE = "pays for a place: the slower lap is longer there, and who creeps never leaves it"
BY_HAND = {
    "centre line in bands": Expected("slow", "?", "standing", PLACE),
    "centre line, linear": Expected("slow", "?", "standing", PLACE),
    "centre line, bell": Expected("slow", "?", "standing", PLACE),
    "inside the borders": Expected("slow", "-", "standing", STAYS),
    "all wheels on track alone": Expected("slow", "-", "standing", STAYS),
    "a constant": Expected("slow", "-", "standing", STAYS),
    "nothing": Expected("alike", "0", "", "pays nothing to anybody"),
    "speed alone": Expected("fast", "+", "", "more metres a second are more"),
    "speed squared": Expected("fast", "+", "", "even the sum of a lap is more at speed"),
    "speed, exponential": Expected("fast", "+", "", "as the square"),
    "speed on the road": Expected("fast", "+", "", "as speed; the wheels are off only when cutting"),
    "speed, minus ten off the road": Expected("fast", "+", "", "as speed; leaving the road costs"),
    "speed above a threshold": Expected("fast", "+", "", "the slow lap and creeping stay below the threshold"),
    "centre line plus speed": Expected("fast", "+", "", "on the centre line speed makes the difference"),
    "centre line times speed": Expected("fast", "+", "", "on the centre line speed makes the difference"),
    "pace for the bend": Expected("fast", "+", "", "the wanted pace is the fast one"),
    "progress over steps": Expected("fast", "+", "", "percent a step is progress a second"),
    "progress so far": Expected("slow", "?", "", "the slow lap is as long at each percent, and who creeps stays low"),
    "progress gained": Expected("fast", "+", "", "percent a step is progress a second"),
    "progress gained, never reset": Expected(
        "fast", "+", "", "as before; the next episode begins with minus the last progress", "reward_remembers"
    ),
    "potential with discount": Expected(
        "fast", "?", "crash", "the end of a lap counts sooner; an early end keeps its potential, which must become 0"
    ),
    "progress minus time": Expected("fast", "+", "", "half a percent a step is more than the slow lap gains"),
    "heading of the waypoints": Expected("slow", "-", "standing", PLACE),
    "line of points": Expected("slow", "?", "standing", PLACE),
    "line of points and pace": Expected("fast", "+", "", "on the same line the pace makes the difference"),
    "steering penalty": Expected("slow", "-", "standing", STAYS),
    "smooth steering": Expected("slow", "-", "standing", STAYS),
    "left lane": Expected("slow", "?", "?", "which side of the centre line a car is on by some mm decides"),
    "reward by steps": Expected("slow", "-", "standing", "late steps are worth most, and who creeps has most steps"),
    "reward by time": Expected("slow", "-", "standing", "as by steps"),
    "survive": Expected("slow", "-", "standing", STAYS),
    "sparse lap bonus": Expected("fast", "+", "", "the bonus comes sooner, and only laps have it"),
    "lap bonus by steps": Expected("fast", "+", "", "the bonus comes sooner and is more"),
    "constant and lap bonus": Expected("fast", "+", "", "the bonus is more than all moments of a lap"),
    "milestones": Expected("fast", "+", "", "the slow lap of 260 steps misses milestones that are set for 200"),
    "minus one a step": Expected("fast", "+", "crash", "fewer moments cost less, the fewest are those until a crash"),
    "minus one a step, minus hundred off": Expected("fast", "+", "", "leaving the road costs more than a lap's time"),
    "minus the distance": Expected("fast", "?", "crash", "negative everywhere: the sooner it ends the better"),
    "slowness": Expected("slow", "-", "standing", "pays for going slowly"),
    "careful": Expected("slow", "-", "standing", "pays for going slowly"),
    "steering as such": Expected("fast", "?", "circles", "the fast lap steers more than the slow one, circles most"),
    "steering times speed": Expected("fast", "?", "circles", "the fast lap steers more, circles most"),
    "not reversed": Expected("slow", "-", "standing", STAYS),
    "objects asked for": Expected("slow", "-", "standing", STAYS),
    "a class": Expected("fast", "+", "", "as speed on the road"),
    "the form of 2018": Expected("fast", "+", "", "as speed on the road"),
    "objects where none are": Expected("alike", "0", "", "fails in every step", "reward_raised:6"),
    "misspelt": Expected("alike", "0", "", "fails in every step", "reward_param_unknown:2"),
    "a default for nothing": Expected("slow", "-", "standing", STAYS, "reward_param_foreign:2"),
    "foreign, behind a condition": Expected("fast", "+", "", "as speed", "reward_param_unknown:3"),
    "nothing on one way": Expected("fast", "+", "", "slow steps give nothing", "reward_not_a_number:2"),
    "not a number": Expected("slow", "-", "standing", STAYS, "reward_not_finite:2"),
    "infinite": Expected("slow", "-", "standing", STAYS, "reward_not_finite:2"),
    "a text": Expected("slow", "-", "standing", "fast steps give nothing", "reward_not_a_number:2"),
    "complex": Expected("?", "?", "?", "near the centre line nothing is a number", "reward_not_a_number:2"),
    "too large": Expected("alike", "?", "standing", "all but creeping is too much", "reward_too_large:2"),
    "division by zero": Expected("?", "?", "?", "fails at step 10 of each drive", "reward_raised:2"),
    "random": Expected("slow", "?", "standing", STAYS, "reward_is_random"),
}
TRAPS = {"standing": "reward_standing_pays", "crash": "reward_crash_pays", "circles": "reward_circles_pay"}
SIGNS = {"reward_follows_progress": "+", "reward_against_progress": "-", "reward_ignores_progress": "0"}


@pytest.fixture(scope="module")
def drives():
    return driven_on_the_oval()


def test_the_table_has_every_shape_and_at_least_forty():
    assert set(BY_HAND) == set(SHAPES)
    assert len(SHAPES) >= 40


@pytest.mark.parametrize("name", SHAPES)
def test_the_audit_agrees_with_the_table(name, drives):
    expected = BY_HAND[name]
    audit = audit_reward(SHAPES[name], drives)
    codes = {finding.fault.code for finding in audit.findings}
    if expected.speed != "?":
        assert f"reward_pays_{expected.speed}" in codes
    if expected.progress != "?":
        assert {SIGNS[code] for code in codes if code in SIGNS} == {expected.progress}
    if expected.traps != "?":
        assert {trap for trap, code in TRAPS.items() if code in codes} == set(expected.traps.split())
        assert ("reward_no_traps" in codes) == (not expected.traps and expected.speed != "alike")
    problems = [failure.problem for failure in audit.failures] + audit.warnings
    notes = {problem.code if problem.line is None else f"{problem.code}:{problem.line}" for problem in problems}
    assert notes == set(expected.notes.split())
    assert ("reward_steps_failed" in codes) == bool(audit.failures)
