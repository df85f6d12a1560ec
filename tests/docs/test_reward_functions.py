"""What rewards.md says of reward functions is what the code does."""

from __future__ import annotations

import re

from config.serving.web import PROCESSES, THREADS
from evaluation.sandbox.limits import REWARD
from paddock.packages.limits import DEFAULT_LIMITS
from training.rewards.examples import EXAMPLES
from training.rewards.sandbox.allowed_modules import ALLOWED
from training.rewards.sandbox.call_limits import KEPT_CHARACTERS, LIMIT_S, PRINTED_CHARACTERS
from training.rewards.sandbox.client import SLOTS, WAITING
from training.rewards.sandbox.function import MAX_REWARD, POSITIONAL_NAMES, load_reward
from training.rewards.sandbox.static_checks import MAX_CHARACTERS
from training.rewards.trial_states import five_states
from training.rewards.validation import check_reward

from .pages import code_blocks, section, text

SECTION = section(text("rewards.md"), "## Write a reward function")
TABLES = [table for table in re.split(r"\n\n", SECTION) if table.startswith("|")]
TYPES = {"bool": bool, "float": float, "int": int}


def rows(table: str) -> list[tuple[list[str], str]]:
    """(names, second cell) of each row."""
    cells = [line.split(" | ") for line in table.splitlines()[2:]]
    return [(re.findall(r"`(\w+)`", first), rest[0]) for first, *rest in cells]


def test_exactly_the_keys_of_params_are_explained_in_order():
    explained = [name for names, _ in rows(TABLES[0]) for name in names]
    assert explained == list(five_states()[0])
    assert len(explained) == 27


def test_the_documented_types_match_the_values():
    params = five_states("object_avoidance")[1]
    for names, told in rows(TABLES[0]):
        kind = told.split(",")[0]
        for name in names:
            value = params[name]
            if kind.startswith("list of"):
                assert type(value) is list, name
                part = value[0]
                expected = tuple if "(x" in kind else TYPES[kind.split()[2]]
                assert type(part) is expected, name
            elif kind.startswith("["):
                assert [type(part) for part in value] == [int, int], name
            else:
                assert type(value) is TYPES[kind], name


def test_every_argument_of_the_first_form_is_explained():
    explained = {name for names, _ in rows(TABLES[1]) for name in names}
    assert explained == set(POSITIONAL_NAMES)
    block = next(block for block in code_blocks(SECTION, "python") if "on_track" in block)
    assert re.findall(r"\w+", block.split("(", 1)[1].split(")")[0]) == list(POSITIONAL_NAMES)


def test_the_snippets_pass_validation():
    blocks = code_blocks(SECTION, "python")
    assert [load_reward(block).form for block in blocks] == ["params", "positional"]
    for block in blocks:
        assert check_reward(block).problems == []


def test_the_documented_bounds_match_the_code():
    page = " ".join(SECTION.split())
    assert f"1 to {MAX_CHARACTERS:,} characters" in page
    assert f"more than {MAX_REWARD:.0f} either way" in page
    assert f"compute for {LIMIT_S:.0f} seconds" in page
    assert f"print {PRINTED_CHARACTERS:,} characters" in page
    assert f"first {KEPT_CHARACTERS:,} characters" in page
    for name in ALLOWED:
        assert f"`{name}`" in page


def test_every_example_is_named():
    page = " ".join(SECTION.split()).lower()
    for example in EXAMPLES[:-1]:
        assert example.title.lower() in page
    assert len(EXAMPLES) == 6


def test_operators_can_read_the_limits_of_a_check():
    page = " ".join(text("operators.md").split())
    assert f"gets {REWARD.address_space_mb} MB and {REWARD.cpu_s} s of CPU time" in page
    assert SLOTS == 2
    assert "at most two at a time." in page


def test_checks_and_uploads_leave_threads_for_other_requests():
    assert SLOTS + WAITING + DEFAULT_LIMITS.slots + DEFAULT_LIMITS.waiting < PROCESSES * THREADS
