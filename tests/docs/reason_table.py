"""The table of reason codes in docs/reference.md, written from the codes themselves.

``python -m tests.docs.reason_table`` writes it anew after a reason was added or reworded.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

from paddock.errors.reasons import REASONS
from tests.shared import CHECKOUT

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference.md"
BEGIN, END = "<!-- reasons: begin -->", "<!-- reasons: end -->"
SECTIONS = (
    "Upload",
    "model_metadata.json",
    "Conversion of a TensorFlow graph",
    "Policies of stable-baselines3",
    "The network",
    "Downloads",
    "On the track",
    "Paddock's own faults",
    "Track files",
    "Recorded drives",
    "Races",
    "Comparing runs",
    "Own runs",
    "Reports",
    "The league",
    "Several cars in a race",
    "Duels",
    "Live events",
    "Videos",
    "Vehicles",
    "Reward functions",
    "Trainings",
    "Courses",
    "Learning platforms (LTI)",
    "Texts",
    "Account",
    "Programs",
    "The stream",
    "Commands",
    "At home",
)
UNANSWERED = ("Commands", "At home")  # a command shows them; no answer over HTTP has them


def files() -> list[Path]:
    """Where the reasons stand: a file of each package that raises any."""
    found = [*CHECKOUT.glob("*/reasons.py"), *CHECKOUT.glob("*/*/reasons.py")]
    return sorted(path for path in found if path.parent.name != "errors")


for path in files():
    import_module(".".join(path.relative_to(CHECKOUT).with_suffix("").parts))


def table() -> str:
    """Every reason code by section with its HTTP status and its sentence; placeholders stand in italics."""
    lines = []
    for title in SECTIONS:
        lines += [f"### {title}", "", "| code | status | what it says |", "|---|---|---|"]
        for code, reason in sorted(REASONS.items()):
            if reason.subject != title:
                continue
            sentence = re.sub(r"%\((\w+)\)s", r"*\1*", reason.sentence).replace("%%", "%").replace("|", "\\|")
            status = "–" if title in UNANSWERED else reason.status
            lines.append(f"| `{code}` | {status} | {sentence} |")
        lines.append("")
    return "\n".join(lines)


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n\n{table()}\n{page[after:]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text()))
