"""The tables of sensors, upload formats and hyperparameters in docs/reference.md, written from their registries.

``python -m tests.docs.small_tables`` writes them after an entry was added or changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from paddock.packages.inputs import IN_STEPS, SENSORS, Sensor
from paddock.packages.kinds import FORMATS
from paddock.rules.hyperparameters import ALGORITHMS, HYPERPARAMETERS, Hyperparameter
from races.models.sensors import OFFERABLE, SAME_AS
from tests.docs.pages import DOCS

PAGE = DOCS / "reference.md"


def sensors() -> list[str]:
    """One row for each sensor."""
    lines = ["| sensor | label | tensor | in races |", "|---|---|---|---|"]
    for sensor in SENSORS.values():
        offered = "yes" if SAME_AS.get(sensor.name, sensor.name) in OFFERABLE else "no"
        label = f"{sensor.label}; same as `{SAME_AS[sensor.name]}`" if sensor.name in SAME_AS else sensor.label
        lines.append(f"| `{sensor.name}` | {label} | {_tensor(sensor)} | {offered} |")
    return lines


def _tensor(sensor: Sensor) -> str:
    if sensor.name == IN_STEPS:
        return "`num_sectors` × `num_values_per_sector`"
    return " × ".join(map(str, sensor.shape))


def formats() -> list[str]:
    """One row for each format of networks that can be uploaded."""
    lines = ["| code in the API | format | suffix |", "|---|---|---|"]
    for one in FORMATS.values():
        lines.append(f"| `{one.code}` | {one.text or one.label} | {f'`{one.suffix}`' if one.suffix else ''} |")
    return lines


def hyperparameters() -> list[str]:
    """One row for each hyperparameter, with the defaults of each algorithm here and on the AWS console."""
    heads = [f"{algorithm.upper()}{console}" for console in ("", " on the console") for algorithm in ALGORITHMS]
    lines = [f"| name | label | range | {' | '.join(heads)} |", f"|---|---|---|{'---|' * len(heads)}"]
    for one in HYPERPARAMETERS.values():
        defaults = [_default(values, algorithm) for values in (one.usual, one.console) for algorithm in ALGORITHMS]
        lines.append(f"| `{one.name}` | {one.label} | {_range(one)} | {' | '.join(defaults)} |")
    return lines


def _default(values: Mapping[str, Any], algorithm: str) -> str:
    value = values.get(algorithm, "")
    return f"`{value}`" if isinstance(value, str) and value else str(value)


def _range(one: Hyperparameter) -> str:
    if one.choices:
        return ", ".join(f"`{choice}`" for choice in one.choices)
    if one.sizes:
        return ", ".join(map(str, one.sizes))
    return f"{one.least:g} to {one.most:g}"


TABLES: Mapping[str, Callable[[], list[str]]] = {
    "sensors": sensors,
    "formats": formats,
    "hyperparameters": hyperparameters,
}


def replaced(page: str, name: str) -> str:
    """``page`` with the present table of this name. Raises ValueError when it has no place for one."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, after = page.index(begin) + len(begin), page.index(end)
    return f"{page[:before]}\n{chr(10).join(TABLES[name]())}\n{page[after:]}"


if __name__ == "__main__":
    for table in TABLES:
        PAGE.write_text(replaced(PAGE.read_text(), table))
