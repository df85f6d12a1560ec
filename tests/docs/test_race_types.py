"""What docs/simulator.md says of boxes, bots and several cars is what the simulator does."""

import re

import pytest

from paddock.rules.race import BOT_SPEED_RANGE_MPS, MAX_BOTS, MAX_BOXES, MAX_CARS, RaceRules
from paddock.simulator import bots, boxes, layout
from paddock.simulator.solids import BOX_HALF_LENGTH_M, BOX_HALF_WIDTH_M, box

from .pages import section, text

PAGE = text("simulator.md")
RULES = RaceRules()
NUMBER_WORDS = {2: "two", 3: "third", 4: "four"}


def words(title):
    return re.sub(r"\s+", " ", section(PAGE, title))


def test_the_facts_about_boxes_are_correct():
    solid = box(0, 0, 0)
    said = words("## Boxes")
    for fact in (
        f"1 to {MAX_BOXES} boxes",
        f"{2 * solid.half_width} m across the road, {2 * solid.half_length} m along it and {solid.height} m high",
        f"at least {layout.START_CLEAR_M} m from the finish line (`box_on_start_line`)",
        f"at least {layout.BOX_SPACING_M} m of track between any two (`boxes_overlap`)",
        f"from {layout.RANDOM_START_CLEAR_M} m after the line to {layout.START_CLEAR_M} m before it",
        f"rectangle of {2 * BOX_HALF_LENGTH_M} m along the road and {2 * BOX_HALF_WIDTH_M} m across it",
        f"less than {boxes.NEAR_M} m away along the track: the car is put {boxes.BEHIND_M} m before the box",
        f"A car whose nose is past a box, {boxes.PASSED_M} m beyond its middle",
        f"the nearest place behind a box is {boxes.BEYOND_M} m beyond its middle",
        f"The {NUMBER_WORDS[RULES.mercy_resets]} reset near one box** puts the car {boxes.AHEAD_M} m behind it",
    ):
        assert fact in said, fact


def test_the_facts_about_bots_are_correct():
    least, most = (ms / 1000 for ms in (RULES.bot_lane_change_least_ms, RULES.bot_lane_change_most_ms))
    said = words("## Bots")
    for fact in (
        f"1 to {MAX_BOTS} bot cars",
        "({:g} to {:g} m/s)".format(*BOT_SPEED_RANGE_MPS),
        f"from {layout.BOTS_START_M} m after the finish line to {layout.BOTS_END_M} m before it",
        f"at least {layout.BOT_SPACING_M:g} m apart (`bots_do_not_fit`",
        f"every {least:g} to {most:g} s",
        f"over {RULES.bot_lane_change_m} m of road",
        f"free for {bots.CLEAR_M} m before and behind",
        f"stays {bots.FOLLOW_M} m (middle to middle) behind",
        f"it pauses for {RULES.bot_pause_ms / 1000:g} s",
    ):
        assert fact in said, fact


def test_the_facts_about_several_cars_are_correct():
    said = words("## Several cars")
    assert f"Two to {NUMBER_WORDS[MAX_CARS]} submitted cars in one world" in said
    assert f"one {RULES.duel_gap_m} m behind the other" in said


@pytest.mark.parametrize("title", ["## Boxes", "## Bots"])
def test_every_named_refusal_has_a_reason(title):
    from paddock.errors.reasons import REASONS

    codes = re.findall(r"`(\w+_\w+_\w+|boxes_overlap)`", section(PAGE, title))
    assert codes and set(codes) <= set(REASONS)
