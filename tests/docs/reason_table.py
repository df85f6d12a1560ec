"""The table of reason codes in docs/racers.md, written from the codes themselves.

``python -m tests.docs.reason_table`` writes it anew after a reason was added or reworded.
"""

from __future__ import annotations

import re
from pathlib import Path

from paddock.errors import reasons

PAGE = Path(__file__).resolve().parents[2] / "docs" / "racers.md"
BEGIN, END = "<!-- reasons: begin -->", "<!-- reasons: end -->"
SECTIONS = {
    "Upload": reasons.upload.REASONS,
    "model_metadata.json": reasons.metadata.REASONS,
    "Conversion of a TensorFlow graph": reasons.conversion.REASONS,
    "Policies of stable-baselines3": reasons.sb3.REASONS,
    "The network": reasons.gate.REASONS,
    "On the track": reasons.run_time.REASONS,
    "Paddock's own faults": reasons.platform.REASONS,
    "Track files": reasons.tracks.REASONS,
    "Recorded drives": reasons.traces.REASONS,
    "Races": reasons.race.REASONS,
    "The league": reasons.league.REASONS,
    "Several cars in a race": reasons.rivals.REASONS,
    "Duels": reasons.duels.REASONS,
    "Videos": reasons.videos.REASONS,
    "Vehicles": reasons.vehicles.REASONS,
    "Reward functions": reasons.training.REASONS,
    "Trainings": reasons.jobs.REASONS,
    "Account": reasons.account.REASONS,
    "Programs": reasons.bodies.REASONS,
    "Commands": reasons.commands.REASONS,
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
