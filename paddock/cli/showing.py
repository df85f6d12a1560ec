"""What the command prints: tables, lap times, how far something is. Figures as on the site."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Any

_BAR = 24
_EVERY_S = 5.0  # between two lines about the same thing, where nobody watches


def lap_time(ms: int | None) -> str:
    """``m:ss.mmm``, a dash for none."""
    return "-" if ms is None else f"{ms // 60_000}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"


def one_line(value: object) -> str:
    """As text without a line's end: what a stranger calls their car begins no line of ours."""
    return " ".join(str(value).splitlines())


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Columns side by side; those of numbers and times to the right."""
    cells = [[one_line(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
    columns = list(zip(*cells, strict=True)) or [()] * len(head)
    right = [bool(column) and all(cell[:1].isdigit() or cell == "-" for cell in column) for column in columns]
    lines = [head, *cells]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in lines
    )


def _plain(text: str) -> str:
    """Without what moves a terminal's cursor or colours: names and sentences come from strangers."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in text)


class Speaker:
    """Where a command says things: its result on standard output, as text or as one JSON value; how far it is on
    standard error, as a line that changes where that is a terminal and now and then as a new one elsewhere. With JSON
    the result alone."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self._shown, self._open = "", False
        self._subject, self._next = "", 0.0

    def result(self, value: Any, text: str) -> None:
        """What came of it, in both forms."""
        self._end()
        print(json.dumps(value, indent=2) if self.as_json else _plain(text))

    def progress(self, text: str, share: float | None = None) -> None:
        """How far it is; the same twice is said once."""
        text = _plain(text)
        if self.as_json or text == self._shown:
            return
        self._shown = text
        if not sys.stderr.isatty():
            subject = text.partition(" ")[0]
            if subject != self._subject or time.monotonic() >= self._next:
                print(text, file=sys.stderr)
                self._subject, self._next = subject, time.monotonic() + _EVERY_S
            return
        bar = ""
        if share is not None:
            full = round(_BAR * min(max(share, 0.0), 1.0))
            bar = f"[{'#' * full}{'.' * (_BAR - full)}] "
        print(f"\r\x1b[K{bar}{text}", end="", file=sys.stderr, flush=True)
        self._open = True

    def note(self, text: str) -> None:
        """Something to know besides."""
        self._end()
        print(_plain(text), file=sys.stderr)

    def _end(self) -> None:
        if self._open:
            print(file=sys.stderr)
            self._open = False
