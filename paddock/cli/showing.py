"""Prints tables, lap times and progress with the number formats of the site."""

import sys
import time
from collections.abc import Sequence
from typing import Any

_BAR = 24
_EVERY_S = 5.0  # between two lines about the same thing, without a terminal


def lap_time(ms: int | None) -> str:
    """``m:ss.mmm``, a dash for none."""
    return "-" if ms is None else f"{ms // 60_000}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"


def one_line(value: object) -> str:
    """The text in one line: a stranger's name for a car must not begin a line of the output."""
    return " ".join(str(value).splitlines())


def table(head: Sequence[str], rows: Sequence[Sequence[object]], none: str = "") -> str:
    """Columns side by side, numbers and times aligned to the right; without rows the text ``none``, if there is one."""
    if none and not rows:
        return none
    cells = [[one_line(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
    columns = list(zip(*cells, strict=True)) or [()] * len(head)
    right = [bool(column) and all(cell[:1].isdigit() or cell == "-" for cell in column) for column in columns]
    formats = "  ".join(
        f"{{:{'>' if to_right else '<'}{width}}}" for width, to_right in zip(widths, right, strict=True)
    )
    return "\n".join(formats.format(*line).rstrip() for line in (head, *cells))


def _plain(text: str) -> str:
    """The text without control characters: names and sentences come from strangers."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in text)


class Speaker:
    """The output of a command: its result on standard output, as text or as one JSON value; without JSON its progress
    on standard error, as a changing line of a terminal, elsewhere as a new line now and then."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self._shown, self._open = "", False
        self._subject, self._next = "", 0.0

    def result(self, value: Any, text: str) -> None:
        self._end()
        if self.as_json:
            import json

            text = json.dumps(value, indent=2)
        print(text if self.as_json else _plain(text))

    def progress(self, text: str, share: float | None = None) -> None:
        """Show the progress; equal messages in a row are shown once."""
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
        """Print a remark on standard error."""
        self._end()
        print(_plain(text), file=sys.stderr)

    def _end(self) -> None:
        if self._open:
            print(file=sys.stderr)
            self._open = False
