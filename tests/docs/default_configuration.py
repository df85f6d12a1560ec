"""The block of docs/environments.md with every option of the environments, written from their default configuration.

``python -m tests.docs.default_configuration`` writes it after an option or a rule was added or changed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from paddock.rules.race import RACE_TYPES, RUN_RULES
from paddock.simulator.envs import DEFAULT_METADATA, default_config

PAGE = Path(__file__).resolve().parents[2] / "docs" / "environments.md"
BEGIN, END = "<!-- config: begin -->", "<!-- config: end -->"


def _value(value: Any) -> str:
    if value == DEFAULT_METADATA:
        return "DEFAULT_METADATA"
    if callable(value):
        return str(value.__name__)
    return type(value).__name__ + "()" if hasattr(value, "__dataclass_fields__") else repr(value)


def _comment(name: str, values: dict[str, Any]) -> str:
    """The unit of a rule, the race types that have it, and other defaults of other types."""
    notes = [RUN_RULES[name].unit] if name in RUN_RULES and RUN_RULES[name].unit else []
    if len(values) < len(RACE_TYPES):
        notes.append(" and ".join(values))
    first, *others = values.items()
    notes += [f"{race_type}: {_value(value)}" for race_type, value in others if value != first[1]]
    return f"  # {'; '.join(notes)}" if notes else ""


def block() -> str:
    """One Python dict with the options of all race types."""
    configs = {race_type: default_config(race_type) for race_type in RACE_TYPES}
    lines = ["```text", "{"]
    for name in dict.fromkeys(name for config in configs.values() for name in config):
        values = {race_type: config[name] for race_type, config in configs.items() if name in config}
        lines.append(f'    "{name}": {_value(next(iter(values.values())))},{_comment(name, values)}')
    return "\n".join([*lines, "}", "```"])


def replaced(page: str) -> str:
    """``page`` with the present block. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{block()}\n{page[after:]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text()))
