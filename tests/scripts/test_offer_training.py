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
        self.only_here: list[bool] = []

    def __call__(
        self, *arguments: str, quiet: bool = False, only_here: bool = False
    ) -> subprocess.CompletedProcess[bytes]:
        if "--dry-run" in arguments:
            report = Path(arguments[arguments.index("--report") + 1])
            report.write_text(json.dumps({"install": [{"metadata": {"name": name}} for name in self.names]}))
        else:
            self.installed.append(arguments)
            self.only_here.append(only_here)
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


def test_training_is_installed_if_torch_is_small(script, monkeypatch, capsys) -> None:
    locked, torch = offer(script, monkeypatch, Pip(SMALL)).installed
    assert "--require-hashes" in locked and "locks/training.txt" in locked
    assert torch[-1] == "torch==2.13.0"
    assert "make training" not in capsys.readouterr().out


def test_cuda_is_not_downloaded_without_being_asked_for(script, monkeypatch, capsys) -> None:
    assert not offer(script, monkeypatch, Pip(LARGE)).installed
    said = capsys.readouterr().out
    assert "2 packages of CUDA" in said and "make training" in said


def test_training_can_be_left_out(script, monkeypatch, capsys) -> None:
    monkeypatch.setenv("TRAINING", "no")
    assert not offer(script, monkeypatch, Pip(SMALL)).installed
    assert "make training" in capsys.readouterr().out


def test_a_failing_pip_dry_run_stops_nothing(script, monkeypatch, capsys) -> None:
    assert not offer(script, monkeypatch, Pip(SMALL, status=1)).installed
    assert "make training" in capsys.readouterr().out


def test_nothing_is_checked_if_training_is_installed(script, monkeypatch) -> None:
    monkeypatch.setattr(script, "find_spec", lambda name: object())
    monkeypatch.setattr(script, "_pip", lambda *arguments, **options: pytest.fail("pip was asked"))
    script.main()


def test_torch_comes_only_from_the_named_index(script, monkeypatch) -> None:
    monkeypatch.setenv("TORCH_INDEX", "https://builds.example.org/cpu")
    monkeypatch.setattr(script.sys, "argv", ["offer_training.py", "--always"])
    pip = Pip(LARGE)
    monkeypatch.setattr(script, "_pip", pip)
    assert script.main() == 0
    alone = pip.installed[pip.only_here.index(True)]
    assert alone[-3:] == ("--index-url", "https://builds.example.org/cpu", "torch==2.13.0") and "--no-deps" in alone
    assert pip.only_here == [False, True, False] and not any("--extra-index-url" in one for one in pip.installed)


def test_a_named_index_overrides_pips_configuration(script, monkeypatch) -> None:
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "https://other.example.org/simple")
    monkeypatch.setenv("PIP_CERT", "/kept")
    asked = []
    monkeypatch.setattr(script.subprocess, "run", lambda command, **options: asked.append(options["env"]))
    script._pip("install", "x", only_here=True)
    script._pip("install", "x")
    assert "PIP_EXTRA_INDEX_URL" not in asked[0] and asked[0]["PIP_CONFIG_FILE"] == "/dev/null"
    assert asked[0]["PIP_CERT"] == "/kept" and asked[1]["PIP_EXTRA_INDEX_URL"]


def test_failing_to_install_requested_training_is_an_error(script, monkeypatch) -> None:
    monkeypatch.setattr(script.sys, "argv", ["offer_training.py", "--always"])
    monkeypatch.setattr(script, "_pip", Pip(SMALL, status=1))
    assert script.main() == 1
