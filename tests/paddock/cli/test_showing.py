"""How far something is: a line that changes on a terminal, now and then a new one elsewhere, nothing with JSON."""

from __future__ import annotations

import io
import sys

import pytest

from paddock.cli import showing
from paddock.cli.showing import Speaker


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch):
    """Puts one in the place of standard error, when the test has begun: pytest puts its own there before."""

    def put() -> Terminal:
        stream = Terminal()
        monkeypatch.setattr(sys, "stderr", stream)
        return stream

    return put


def test_a_terminal_shows_a_bar_that_moves(terminal):
    err = terminal()
    speaker = Speaker(False)
    speaker.progress("place 2 of 3 in the queue, about 4 s")
    speaker.progress("lap 2 of 3, 25 %", (1 + 0.25) / 3)
    speaker.result({}, "done")
    shown = err.getvalue().split("\r\x1b[K")
    assert shown[1] == "place 2 of 3 in the queue, about 4 s"
    assert shown[2] == "[##########..............] lap 2 of 3, 25 %\n"


def test_elsewhere_a_line_is_said_now_and_then(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 6.0, 6.0])
    monkeypatch.setattr(showing.time, "monotonic", lambda: next(clock))
    speaker = Speaker(False)
    for text in ("lap 1 of 3, 5 %", "lap 1 of 3, 40 %", "lap 2 of 3, 80 %"):
        speaker.progress(text)
    assert capsys.readouterr().err == "lap 1 of 3, 5 %\nlap 2 of 3, 80 %\n"


def test_json_is_alone(terminal, capsys):
    err = terminal()
    speaker = Speaker(True)
    speaker.progress("lap 1 of 3, 5 %", 0.02)
    speaker.result({"laps": [7148]}, "words")
    assert err.getvalue() == "" and capsys.readouterr().out == '{\n  "laps": [\n    7148\n  ]\n}\n'
