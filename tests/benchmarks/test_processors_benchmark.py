"""The benchmark of processors counts what is equal, and says what of its promises is broken."""

from __future__ import annotations

import json
import platform

import pytest

from benchmarks import processors
from training.golden.processors import emulator


def figures(**changes: object) -> dict:
    """Figures that keep every promise."""
    return {
        "machine": {"cpu": "c", "cores": 2, "load_before": 0.1, "load_after": 0.2, "engine": "e"},
        "race": {"laps": 3, "tracks": ["oval"]},
        "runs": 2,
        "equal": 2,
        "by_processor": {"Nehalem": {"runs": 2, "equal": 2, "equal_times": 2, "differ": []}},
        "steps": {"console": 100, "flyer": 100},
        "slow_steps": {"console": 0.0, "flyer": 0.02},
        "bound_used": {"console": 0.1, "flyer": 0.2},
        "cost": {"console": 1.01, "flyer": 1.1},
        "network_cost": {"console": 1.02, "flyer": 1.2},
    } | changes


def test_figures_that_keep_every_promise_have_no_miss() -> None:
    assert processors.misses(figures()) == []
    assert "2 of 2 equal" in processors.table(figures()) and "Missed" not in processors.table(figures())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {
                "equal": 1,
                "by_processor": {"Nehalem": {"runs": 2, "equal": 1, "equal_times": 2, "differ": ["flyer on oval"]}},
            },
            "1 of 2 runs are equal (Nehalem: flyer on oval)",
        ),
        ({"cost": {"console": 1.04}}, "console's run takes 1.040 times as long; 1.03 is promised"),
        ({"cost": {"flyer": 1.16}}, "flyer's run takes 1.160 times as long; 1.15 is promised"),
        ({"bound_used": {"flyer": 1.5}}, "flyer's errors are 1.50 times its bound"),
    ],
)
def test_a_broken_promise_is_named(change: dict, said: str) -> None:
    (found,) = processors.misses(figures(**change))
    assert said == found


@pytest.mark.parametrize("there", [True, False], ids=["beside the checkout", "nowhere"])
def test_it_drives_six_tracks_on_any_machine(there, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(processors, "TRACKS", tmp_path)
    for name in processors.COMMUNITY if there else ():
        (tmp_path / f"{name}.npy").touch()
    found = processors.tracks()
    assert len(set(found)) == 6 and all(name.endswith(".npy") is there for name in found)


def test_a_missing_emulator_says_what_to_install(monkeypatch, capsys) -> None:
    monkeypatch.setattr(processors, "emulator", lambda: None)
    assert processors.main([]) == 2
    assert "Debian: qemu-user" in capsys.readouterr().err


@pytest.mark.soak
@pytest.mark.skipif(platform.machine() != "x86_64" or emulator() is None, reason="there is no emulator here")
def test_it_compares_a_lap_and_counts_its_decisions(monkeypatch) -> None:
    monkeypatch.setattr(processors, "HOUSE_CARS", ("flyer",))
    monkeypatch.setattr(processors, "CONSOLE_CAR", processors.TRACKS / "nowhere")
    found = processors.run(names=["oval"], laps=1, processors=["Nehalem"])
    assert found["processors"] == ["native", "Nehalem"]
    assert (found["runs"], found["equal"]) == (1, 1)
    assert found["by_processor"] == {"Nehalem": {"runs": 1, "equal": 1, "equal_times": 1, "differ": []}}
    assert found["steps"]["flyer"] > 90 and 0 <= found["slow_steps"]["flyer"] < 0.2
    assert 0 < found["bound_used"]["flyer"] <= 1
    assert 0.5 < found["cost"]["flyer"] < 3 and 0.5 < found["network_cost"]["flyer"] < 5
    json.dumps(found)


def test_its_process_refuses_to_measure_without_the_pins(monkeypatch, capsys) -> None:
    from benchmarks import decisions

    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    assert decisions.main() == 2
    assert "python -m paddock.exact" in capsys.readouterr().err
