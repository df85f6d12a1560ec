"""The tables of rules in the docs, written from the list of them.

``python -m tests.docs.rule_tables`` writes them anew after a rule was added or changed.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from paddock.rules.race import BY_PLACE, RULES, RUN_RULES
from paddock.rules.rule import Rule

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- rules: begin -->", "<!-- rules: end -->"


_WORDS = {"object_avoidance": "object avoidance", "head_to_head": "head-to-head"}


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


def _meaning(rule: Rule) -> str:
    types = " and ".join(_WORDS[one] for one in rule.race_types)
    said = f"{rule.label}. {rule.help}".strip()
    return f"{types.capitalize()}: {said}" if types else said


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def organisers() -> str:
    """What an organiser sets."""
    lines = [_row("rule", "meaning", "default", "range"), "|---|---|---|---|"]
    for rule in (RULES[name] for name in BY_PLACE):
        bounds = [f"{one:,}".replace(",", " ") for one in (rule.least, rule.most) if one is not None]
        shown = " to ".join(bounds) or ", ".join(f"`{one}`" for one in rule.choices)
        lines.append(_row(f"`{rule.name}`", _meaning(rule), _value(rule, rule.default), shown))
    return "\n".join(lines)


def environments() -> str:
    """What an environment takes."""
    lines = [_row("argument", "meaning", "default"), "|---|---|---|"]
    asked: Iterable[Rule] = (rule for name, rule in RUN_RULES.items() if name not in ("race_type", "seed"))
    for rule in asked:
        default = rule.proposed or rule.default_of_an_episode
        lines.append(_row(f"`{rule.name}`", _meaning(rule), f"{default!r}"))
    return "\n".join(lines)


PAGES = {"organisers.md": organisers, "environments.md": environments}


def replaced(page: str, table: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{table}\n{page[after:]}"


if __name__ == "__main__":
    for name, table in PAGES.items():
        path = DOCS / name
        path.write_text(replaced(path.read_text(), table()))
