"""The table of rules in docs/reference.md, written from the list of them.

``python -m tests.docs.rule_table`` writes it anew after a rule was added or changed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from config.guides.translation import rule_meaning
from paddock.rules.race import BY_PLACE, RULES, RUN_RULES
from paddock.rules.rule import Rule
from races.boards import ranking  # noqa: F401  the ranking methods are registered

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference.md"
BEGIN, END = "<!-- rules: begin -->", "<!-- rules: end -->"


def _value(rule: Rule, value: Any) -> str:
    if value == rule.unlimited and value is not None:
        return "no limit"
    if isinstance(value, tuple):
        return ", ".join(f"`{one}`" for one in value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return f"`{value}`" if value else ""
    return f"{value:,}".replace(",", " ") if isinstance(value, int) else f"{value:g}"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def table() -> str:
    """What an organiser sets, then what runs alone take; with the default of an environment."""
    lines = [_row("rule", "meaning", "default", "range", "in an environment"), "|---|---|---|---|---|"]
    for rule in (*(RULES[name] for name in BY_PLACE), *(one for one in RUN_RULES.values() if one.run_only)):
        bounds = [f"{one:,}".replace(",", " ") for one in (rule.least, rule.most) if one is not None]
        shown = " to ".join(bounds) if rule.most is not None else ", ".join(f"`{one}`" for one in rule.choices)
        taken = rule.name in RUN_RULES and rule.name not in ("race_type", "seed")
        own = _value(rule, rule.proposed or rule.default_of_an_episode) if taken else ""
        default = "" if rule.run_only else _value(rule, rule.default)
        lines.append(_row(f"`{rule.name}`", rule_meaning(rule), default, shown, own))
    return "\n".join(lines)


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{table()}\n{page[after:]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text()))
