"""What a car's report drives, as plain values: kinds of variations, how many, how strong."""

from __future__ import annotations

from .race import UNTIL_THE_FIRST_FAULT, RaceRules

START, LIGHT, COLOURS, SENSORS, ALL = KINDS = ("start", "light", "colours", "sensors", "all")
EACH = 20  # of each kind, from mild to as much as is sensible
VARIATIONS = EACH * len(KINDS)
MOST_SEED = 2**31 - 1
# One lap until the first fault: how far a car comes by itself, and how fast.
LAP = RaceRules(laps=1, **UNTIL_THE_FIRST_FAULT)


def kind_of(variation: int) -> str:
    """The kind of a variation, by its number from 0."""
    return KINDS[variation // EACH]


def percent_of(variation: int) -> int:
    """How strong a variation is, by its number; 100 is as much as is sensible."""
    return 100 * (variation % EACH + 1) // EACH
