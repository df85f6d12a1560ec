"""The rules of docs/analysis.md are those of the code."""

import re

from paddock.analysis import losses
from paddock.analysis.losses import LEAST, Mistake
from paddock.analysis.mini_sectors import MINI_SECTORS
from races.telemetry.document import REASONS
from tests.docs.pages import section, text

PAGE = text("analysis.md")
WORDS = {mistake: re.sub(r"%s m(/s)? ?", "", str(REASONS[mistake])) for mistake in Mistake}
LEFT_OVER = {Mistake.SLOWER, Mistake.LONGER}  # what no other reason explains


def test_every_reason_has_its_rule_and_its_least_value():
    rows = dict(re.findall(r"^\| ([^|]+) \|.*\| ([^|]+) \|$", section(PAGE, "## Where time was lost"), flags=re.M))
    for mistake in set(LEAST) - LEFT_OVER:
        number, unit = rows[WORDS[mistake]].split()
        assert float(number) == LEAST[mistake]
        assert f"%s {unit}" in str(REASONS[mistake])
    for mistake in set(Mistake) - set(LEAST) | LEFT_OVER:
        assert any(WORDS[mistake] in reason for reason in rows)


def test_the_numbers_of_the_rules_are_those_of_the_code():
    part = " ".join(section(PAGE, "## Where time was lost").split())
    assert losses.APPROACH_M == losses.EXIT_M == losses.STRAIGHT_M == 1.5
    for fact in (
        f"from {losses.APPROACH_M} m before it to {losses.EXIT_M} m behind it",
        f"at least {losses.STRAIGHT_M} m long",
        f"at least {losses.LEAST_MS / 1000:g} s",
        f"at least {losses.SHARE:.0%} ".replace("%", " %"),
        f"within {losses.TURN_IN_M:g} m of the beginning",
    ):
        assert fact in part
    assert (losses.LARGEST, losses.REASONS, losses.AFTERMATH) == (3, 2, 0.5)
    assert "Up to three losses" in part and "The two reasons" in part and "less than half" in part
    assert f"A lap has {MINI_SECTORS} mini-sectors" in PAGE
