"""``python -m benchmarks.curves FILE.json… OUT.svg``: draws what ``benchmarks.board --json`` printed, a panel each.

Both axes are logarithmic: a line that runs level is a cost that does not notice how long the board is.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 660, 430, 64, 220, 44, 56
# Told apart without colours too: each line ends in its name.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#5c5c5c", "#aa3377")
LINE_PX = 14.0  # at least so far apart stand the names
_TITLES = {"sqlite": "SQLite", "postgresql": "PostgreSQL"}


def svg(panels: list[dict[str, Any]]) -> str:
    """One picture of the figures of one or more databases, beside each other, with the same axis of milliseconds."""
    times = [ms for panel in panels for look in panel["looks"].values() for ms in look["ms"]]
    low, high = math.floor(math.log10(min(times))), math.ceil(math.log10(max(times)))
    body = [_panel(panel, number * WIDTH, low, high) for number, panel in enumerate(panels)]
    width = WIDTH * len(panels)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" role="img" '
        'font-family="system-ui, sans-serif" font-size="12" fill="#222">\n'
        "<title>What boards cost as they grow</title>\n"
        f'<rect width="{width}" height="{HEIGHT}" fill="#fff"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def _panel(panel: dict[str, Any], at: float, low: int, high: int) -> str:
    sizes = panel["sizes"]
    first, last = math.log10(sizes[0]), math.log10(sizes[-1])
    right, bottom = at + WIDTH - RIGHT, HEIGHT - BOTTOM

    def x(size: float) -> float:
        share = (math.log10(size) - first) / (last - first or 1.0)
        return at + LEFT + share * (WIDTH - LEFT - RIGHT)

    def y(ms: float) -> float:
        return bottom - (math.log10(ms) - low) / (high - low) * (bottom - TOP)

    parts = [_text(at + LEFT, TOP - 20, _TITLES.get(panel["database"], panel["database"]), weight="bold")]
    for power in range(low, high + 1):
        parts.append(_line([(at + LEFT, y(10.0**power)), (right, y(10.0**power))], "#ddd", 1))
        parts.append(_text(at + LEFT - 6, y(10.0**power) + 4, f"{10.0**power:g} ms", anchor="end"))
    for size in sizes:
        parts.append(_line([(x(size), TOP), (x(size), bottom)], "#eee", 1))
        parts.append(_text(x(size), bottom + 18, f"{size:,}", anchor="middle"))
    parts.append(_text((at + LEFT + right) / 2, bottom + 38, "entries on the board", anchor="middle"))
    ends = _apart({name: y(look["ms"][-1]) for name, look in panel["looks"].items()})
    for colour, (name, look) in zip(COLOURS, panel["looks"].items(), strict=False):
        points = [(x(size), y(ms)) for size, ms in zip(sizes, look["ms"], strict=True)]
        parts.append(_line(points, colour, 2))
        parts += [f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3" fill="{colour}"/>' for px, py in points]
        parts.append(_line([points[-1], (right + 12, ends[name])], colour, 0.7))
        parts.append(_text(right + 15, ends[name] + 4, f"{name} ×{look['ratio']:.2f}", fill=colour))
    return "\n".join(parts)


def _apart(wanted: dict[str, float]) -> dict[str, float]:
    """Heights as near as they can be to those wanted, from the top, so that no two names overlap."""
    placed, before = {}, -math.inf
    for name, height in sorted(wanted.items(), key=lambda one: one[1]):
        placed[name] = before = max(height, before + LINE_PX)
    return placed


def _line(points: list[tuple[float, float]], colour: str, width: float) -> str:
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _text(x: float, y: float, text: str, *, anchor: str = "start", weight: str = "normal", fill: str = "#222") -> str:
    style = f'text-anchor="{anchor}" font-weight="{weight}" fill="{fill}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}>{escape(text)}</text>'


def main(arguments: list[str] | None = None) -> int:
    """Read, draw, write; 2 when the arguments are not at least a file to read and one to write."""
    paths = [Path(one) for one in (sys.argv[1:] if arguments is None else arguments)]
    if len(paths) < 2 or paths[-1].suffix != ".svg":
        print("usage: python -m benchmarks.curves FILE.json… OUT.svg", file=sys.stderr)
        return 2
    paths[-1].write_text(svg([json.loads(path.read_text()) for path in paths[:-1]]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
