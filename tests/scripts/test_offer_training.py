"""What ``make run`` does about training: installs it where that is small, else tells how to have it."""

from __future__ import annotations

import importlib.util
import json
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "offer_training.py"
SMALL = ["torch", "sympy", "stable_baselines3"]
LARGE = ["torch", "nvidia-cublas", "triton", "stable_baselines3"]


class Pip:
    """pip that would fetch ``names``; ``status``: its exit status. Remembers what it installed."""

    def __init__(self, names: list[str], status: int = 0) -> None:
        self.names = names
        self.status = status
        self.installed: list[tuple[str, ...]] = []

    def __call__(self, *arguments: str, quiet: bool = False) -> subprocess.CompletedProcess[bytes]:
        if "--dry-run" in arguments:
            report = Path(arguments[arguments.index("--report") + 1])
            report.write_text(json.dumps({"install": [{"metadata": {"name": name}} for name in self.names]}))
        else:
            self.installed.append(arguments)
        return subprocess.CompletedProcess(arguments, self.status)


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, on a machine without training."""
    spec = importlib.util.spec_from_file_location("offer_training", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    monkeypatch.delenv("TRAINING", raising=False)
    return module


def offer(script: ModuleType, monkeypatch: pytest.MonkeyPatch, pip: Pip) -> Pip:
    monkeypatch.setattr(script, "_pip", pip)
    script.main()
    return pip


def test_training_comes_along_where_torch_is_small(script, monkeypatch, capsys) -> None:
    assert len(offer(script, monkeypatch, Pip(SMALL)).installed) == 1
    assert "make training" not in capsys.readouterr().out


def test_gigabytes_of_cuda_are_not_fetched_unasked(script, monkeypatch, capsys) -> None:
    assert not offer(script, monkeypatch, Pip(LARGE)).installed
    said = capsys.readouterr().out
    assert "2 packages of CUDA" in said and "make training" in said


def test_it_can_be_left_out(script, monkeypatch, capsys) -> None:
    monkeypatch.setenv("TRAINING", "no")
    assert not offer(script, monkeypatch, Pip(SMALL)).installed
    assert "make training" in capsys.readouterr().out


def test_a_pip_that_cannot_tell_stops_nothing(script, monkeypatch, capsys) -> None:
    assert not offer(script, monkeypatch, Pip(SMALL, status=1)).installed
    assert "make training" in capsys.readouterr().out


def test_nothing_is_looked_at_where_training_is_installed(script, monkeypatch) -> None:
    monkeypatch.setattr(script, "find_spec", lambda name: object())
    monkeypatch.setattr(script, "_pip", lambda *arguments, **options: pytest.fail("pip was asked"))
    script.main()
