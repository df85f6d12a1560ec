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
        for kept in (lettering._font_for, lettering._system_fonts, lettering.mask, lettering.shortened):
            kept.cache_clear()

    def test_text_without_system_fonts_is_reduced_to_plain_letters(self, monkeypatch):
        def absent(*args, **kwargs):
            raise FileNotFoundError("fc-match")

        self.forget()
        monkeypatch.setattr(subprocess, "run", absent)
        assert lettering.drawable("Café – 한국어 – ok −1") == "Cafe -  - ok -1"
        assert not lettering.is_drawable("랩") and lettering.is_drawable("Lap 1")
        assert lettering.mask("한국어", 20).shape[0] == lettering.mask("Lap", 20).shape[0]

    @pytest.mark.parametrize(
        "answer",
        ["", "x", "/nowhere.ttf\n0\n", "/etc/passwd\n0\n", "a.ttf\nb\n", subprocess.TimeoutExpired("fc-match", 5)],
    )
    def test_a_hanging_or_lying_font_tool_is_ignored(self, monkeypatch, answer):
        self.forget()
        asked = self.answers(monkeypatch, answer)
        assert lettering.drawable("가나다라마바사") == ""
        assert len(asked) == 1, "once, whatever it said"

    def test_fonts_are_asked_for_once_and_tried_in_their_order(self, monkeypatch, tmp_path):
        self.forget()
        bold = tmp_path / "plain.ttf"
        bold.write_bytes(lettering.own_font(20).font_bytes)
        asked = self.answers(monkeypatch, f"/nowhere.ttf\n0\n{bold}\n0\n")
        assert lettering.system_font("a") == lettering.system_font("b") == (str(bold), 0)
        assert lettering.drawable("a가나b") == "ab" and len(asked) == 1

    @staticmethod
    def answers(monkeypatch, answer) -> list:
        asked = []

        def run(*args, **kwargs):
            asked.append(args)
            if isinstance(answer, Exception):
                raise answer
            return subprocess.CompletedProcess(args, 0, answer)

        monkeypatch.setattr(subprocess, "run", run)
        return asked

    def test_a_long_text_is_shortened_to_fit(self):
        short = lettering.shortened("x" * 64, 20, True, 150)
        assert short.endswith("...") and lettering.mask(short, 20, True).shape[1] <= 150
        assert lettering.shortened("short", 20, True, 150) == "short"

    def test_control_characters_are_not_drawn(self):
        assert lettering.drawable("a\x00b\u202ec\n d") == "abc d"
