"""The settings of a car's report: kinds, number and strength of the variations."""

from .race import UNTIL_THE_FIRST_FAULT, RaceRules

START, LIGHT, COLOURS, SENSORS, ALL = KINDS = ("start", "light", "colours", "sensors", "all")
EACH = 20  # of each kind, from mild to full strength
VARIATIONS = EACH * len(KINDS)
MOST_SEED = 2**31 - 1
LAP = RaceRules(laps=1, **UNTIL_THE_FIRST_FAULT)


def kind_of(variation: int) -> str:
    return KINDS[variation // EACH]


def percent_of(variation: int) -> int:
    return 100 * (variation % EACH + 1) // EACH
