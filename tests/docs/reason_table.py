"""The table of reason codes in docs/racers.md, written from the codes themselves.

``python -m tests.docs.reason_table`` writes it anew after a reason was added or reworded.
"""

from __future__ import annotations

import re
from pathlib import Path

from faults import reasons

PAGE = Path(__file__).resolve().parents[2] / "docs" / "racers.md"
BEGIN, END = "<!-- reasons: begin -->", "<!-- reasons: end -->"
SECTIONS = {
    "Upload": reasons._UPLOAD,
    "model_metadata.json": reasons._METADATA,
    "Conversion of a TensorFlow graph": reasons._CONVERSION,
    "The network": reasons._GATE,
    "On the track": reasons._RUN_TIME,
    "Paddock's own faults": reasons._PLATFORM,
    "Track files": reasons._TRACKS,
    "Races": reasons._RACE,
    "Account": reasons._ACCOUNT,
}


def table() -> str:
    """Every reason code by section with its sentence; placeholders stand in italics."""
    lines = []
    for title, section in SECTIONS.items():
        lines += [f"### {title}", "", "| code | what it says |", "|---|---|"]
        for code, reason in section.items():
            sentence = re.sub(r"%\((\w+)\)s", r"*\1*", reason.sentence).replace("%%", "%").replace("|", "\\|")
            lines.append(f"| `{code}` | {sentence} |")
        lines.append("")
    return "\n".join(lines)


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n\n{table()}\n{page[after:]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text()))
