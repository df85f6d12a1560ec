"""The table of kinds of notices in docs/api.md, written from the list of kinds.

``python -m tests.docs.notice_table`` writes it after a kind was added or changed.
"""

from __future__ import annotations

from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
BEGIN, END = "<!-- notices: begin -->", "<!-- notices: end -->"


def table() -> str:
    """A row for each kind."""
    from league.notices.kinds import KINDS

    lines = ["| kind | when | by e-mail unless turned off | webhook event in the same words |", "|---|---|---|---|"]
    for kind in KINDS.values():
        webhook = f"`{kind.webhook}`" if kind.webhook else ""
        lines.append(f"| `{kind}` | {kind.label} | {'yes' if kind.mailed else 'no'} | {webhook} |")
    return "\n".join(lines)


def replaced(page: str) -> str:
    """``page`` with the present table. Raises ValueError when it has no place for one."""
    before, after = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:before]}\n{table()}\n{page[after:]}"


if __name__ == "__main__":
    import os

    import django

    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    PAGE.write_text(replaced(PAGE.read_text()))
