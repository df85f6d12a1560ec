"""Every hostile reward function ends with the code that its folder is named after, in a line marked ``# here``.

``tests/hostile/reward_<...>/<case>.txt`` is the function itself.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from evaluation.sandbox.limits import REWARD
from tests.soak import one_of_each
from training.rewards.reasons import REWARD_REASONS
from training.rewards.validation import check_reward

from .test_hostile import children, descriptors, is_left


def validate_reward(code, **options):
    return check_reward(code, **options).problems


HERE = Path(__file__).parent
CASES = sorted(path.relative_to(HERE).with_suffix("").as_posix() for path in HERE.glob("reward_*/*.txt"))
COMPUTING = ("reward_too_slow", "reward_memory")
GOOD = "def reward_function(params):\n    return params['progress']\n"
SLOW = ("reward_stuck/waits_for_ever", "reward_prints_too_much/a_gigabyte_at_once")


def takes_seconds(case: str) -> bool:
    return case.startswith(COMPUTING) or case in SLOW


def parameters() -> list:
    """One of each kind; those that take seconds are journeys."""
    return [
        pytest.param(*one.values, marks=[*one.marks, pytest.mark.slow]) if takes_seconds(one.values[0]) else one
        for one in one_of_each(CASES, kind=lambda case: case.split("/")[0] if takes_seconds(case) else case)
    ]


def source(case: str) -> str:
    return (HERE / f"{case}.txt").read_text()


# From 2.41 on, abort() blocks the signal whose handler writes the line
GLIBC = tuple(map(int, os.confstr("CS_GNU_LIBC_VERSION").split()[1].split(".")))


def marked_lines(text: str) -> set[int | None]:
    """The lines to be told, one of them; a loop may be stopped at its head or in its body."""
    lines = {number for number, line in enumerate(text.splitlines(), 1) if line.endswith("# here")}
    return lines | {None} if not lines or (".abort()" in text and GLIBC >= (2, 41)) else lines


@pytest.mark.parametrize("case", parameters())
def test_a_hostile_reward_function_ends_with_its_code_and_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = source(case)
    before, began = (descriptors(), children()), time.monotonic()
    problems = validate_reward(text)
    (problem,) = problems
    assert problem.code == case.split("/")[0]
    assert problem.line in marked_lines(text)
    assert str(problem.fault) == REWARD_REASONS[problem.code].sentence % problem.params, "a parameter is missing"
    assert str(problem.fault).isprintable()
    assert not is_left(before), "something was left open or running"
    assert list(tmp_path.iterdir()) == [], "something was written"
    assert time.monotonic() - began < REWARD.wall_s + 5.0


def test_a_function_forging_its_answer_affects_only_itself() -> None:
    """It may say of itself that all is well, as it may say so by returning a 1; the next function is judged anew."""
    liar = source("reward_stuck/answers_with_an_endless_reward").replace("1e999", "7.0")
    assert check_reward(liar).rewards == {"start": 7.0}
    assert validate_reward(GOOD) == []
    assert [problem.code for problem in validate_reward(source("reward_not_finite/nan"))] == ["reward_not_finite"]


def test_one_character_more_than_allowed_is_too_long() -> None:
    longest = GOOD + "#" * (140_000 - len(GOOD))
    assert validate_reward(longest) == []
    assert [problem.code for problem in validate_reward(longest + "#")] == ["reward_length"]


@pytest.mark.parametrize(
    "text",
    [
        "(" * 50_000,
        "-" * 100_000 + "1",
        "a." * 60_000 + "a",
        "[" * 90 + "]" * 90 + "\n" + "if 1:\n" + " if 1:\n" * 1,
        "x = '\0'",
        "x = '\ud800'",
        "\ufeff\x0c" * 1000 + "%",
        "lambda: " * 15_000 + "1",
        "f(" * 30_000,
        "x" + "[0]" * 40_000,
    ],
    ids=range(10),
)
def test_text_that_attacks_the_parser_is_refused(text: str) -> None:
    (problem,) = validate_reward(text)
    assert problem.code in ("reward_syntax", "reward_stuck", "reward_function_missing", "reward_memory")
    assert str(problem.fault).isprintable()


def test_every_code_of_a_reward_function_has_a_case() -> None:
    assert {case.split("/")[0] for case in CASES} == set(REWARD_REASONS)
