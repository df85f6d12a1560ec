"""Which browser the tests start."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pages.browsing import find_browser


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Put programs into folders that are all there is."""
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "playwright"))

    def with_programs(*names: str) -> Path:
        for name in names:
            program = tmp_path / name
            program.parent.mkdir(parents=True, exist_ok=True)
            program.touch(mode=0o755)
        monkeypatch.setenv("PATH", str(tmp_path / "bin"))
        return tmp_path

    return with_programs


NEW, OLD = (f"playwright/chromium-{number}/chrome-linux/chrome" for number in (1200, 1100))
SHELL = "playwright/chromium_headless_shell-1200/chrome-linux/headless_shell"


@pytest.mark.parametrize(
    ("programs", "found"),
    [
        (("bin/google-chrome", "bin/chromium", NEW), "bin/chromium"),
        (("bin/chromium", "bin/chromium-headless-shell"), "bin/chromium-headless-shell"),
        (("bin/google-chrome", NEW, SHELL), "bin/google-chrome"),
        ((OLD, NEW), NEW),
        ((NEW, SHELL), SHELL),
        (("bin/firefox",), None),
    ],
)
def test_a_browser_of_the_system_goes_before_playwrights(machine, programs, found):
    folder = machine(*programs)
    assert find_browser() == (found and str(folder / found))


def test_a_snap_is_no_browser_for_tests(machine, monkeypatch):
    machine()
    monkeypatch.setattr("shutil.which", lambda name: f"/snap/bin/{name}")
    assert find_browser() is None
