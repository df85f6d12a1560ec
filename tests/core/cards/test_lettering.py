"""Text in the fonts that are there."""

from __future__ import annotations

import subprocess

import pytest

from core.cards import lettering


class TestLetters:
    @pytest.fixture(autouse=True)
    def fresh(self):
        yield
        self.forget()

    def forget(self):
        for kept in (lettering._font_for, lettering.mask, lettering.shortened):
            kept.cache_clear()
        lettering._found.clear()
        lettering._failures.clear()

    def test_text_without_system_fonts_is_reduced_to_plain_letters(self, monkeypatch):
        def absent(*args, **kwargs):
            raise FileNotFoundError("fc-match")

        self.forget()
        monkeypatch.setattr(subprocess, "run", absent)
        assert lettering.drawable("Café – 한국어 – ok −1") == "Cafe -  - ok -1"
        assert not lettering.is_drawable("랩") and lettering.is_drawable("Lap 1")
        assert lettering.mask("한국어", 20).shape[0] == lettering.mask("Lap", 20).shape[0]

    def test_a_hanging_or_lying_font_tool_is_ignored(self, monkeypatch):
        self.forget()
        answers = iter(["", "/nowhere.ttf\n0", "/etc/passwd\n0", "x", subprocess.TimeoutExpired("fc-match", 5)])

        def run(*args, **kwargs):
            answer = next(answers)
            if isinstance(answer, Exception):
                raise answer
            return subprocess.CompletedProcess(args, 0, answer)

        monkeypatch.setattr(subprocess, "run", run)
        assert lettering.drawable("가나다라마바사") == ""  # after the last answer nobody asks again

    def test_a_long_text_is_shortened_to_fit(self):
        short = lettering.shortened("x" * 64, 20, True, 150)
        assert short.endswith("...") and lettering.mask(short, 20, True).shape[1] <= 150
        assert lettering.shortened("short", 20, True, 150) == "short"

    def test_control_characters_are_not_drawn(self):
        assert lettering.drawable("a\x00b\u202ec\n d") == "abc d"
