"""The table of the catalogue in docs/tracks.md, written from the list of it.

``python -m tests.docs.track_table`` writes it anew after a track was added.
"""

from __future__ import annotations

from pathlib import Path

from paddock.geometry.catalogue import CATALOGUE

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tracks.md"
BEGIN, END = "<!-- tracks: begin -->", "<!-- tracks: end -->"


def table() -> str:
    """One row a track, in the order of the catalogue."""
    lines = [
        "| track | address | file | length | width | drawn | corners | difficulty |",
        "|---|---|---|---:|---:|---|---:|---:|",
    ]
    for entry in CATALOGUE:
        lines.append(
            f"| {entry.name} | `{entry.slug}` | `{entry.file}` | {entry.length_m:.2f} m | {entry.width_m:.2f} m | "
            f"{entry.direction} | {entry.corners} | {entry.difficulty} |"
        )
    return "\n".join(lines)


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{table()}\n{page[after:]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text()))
