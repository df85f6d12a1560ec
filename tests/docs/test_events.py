"""docs/architecture.md lists every kind of event as it is registered, every reader and every signal."""

from __future__ import annotations

from importlib import import_module

from django.dispatch import Signal

from core.events import KINDS
from core.events.reading import READERS

from .pages import section, text

ROOMS = ("accounts", "evaluation", "races")


def rows(heading: str) -> dict[str, list[str]]:
    """The cells of a table by what stands first in each row."""
    table = section(text("architecture.md"), heading).split("\n|---")[1].split("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.split("\n")[1:] if line]
    return {first.strip("`"): rest for first, *rest in cells}


def test_every_kind_has_a_row_as_registered():
    told = {}
    for kind in KINDS.values():
        readers = sorted(reader.name for reader in READERS.values() if kind in reader.kinds)
        told[kind.name] = [
            kind.summary,
            ", ".join(kind.names),
            ", ".join(f"`{name}`" for name in kind.data),
            kind.once,
            ", ".join(f"`{name}`" for name in readers),
        ]
    assert rows("### Kinds of events") == told and "race.official" in told


def test_every_reader_has_a_row():
    assert set(rows("### Readers of events")) == set(READERS)


def test_every_signal_has_a_row():
    ours = set()
    for room in ROOMS:
        found = vars(import_module(f"{room}.signals"))
        ours |= {f"{room}.signals.{name}" for name, one in found.items() if isinstance(one, Signal)}
    assert set(rows("### Signals that remain")) == ours
