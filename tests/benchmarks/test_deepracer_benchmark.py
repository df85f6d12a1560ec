"""The benchmark of ``deepracer-v0`` measures every kind of it, and counts what it promises."""

from __future__ import annotations

from benchmarks import deepracer


def test_every_set_of_sensors_is_measured_with_every_kind_of_object(monkeypatch):
    monkeypatch.setattr(deepracer, "TRACKS", deepracer.TRACKS[:1])
    monkeypatch.setattr(deepracer, "RUNS", 1)
    found = deepracer.rows(20)
    assert len(found) == (len(deepracer.OBJECTS) + 1) * len(deepracer.SENSORS)
    assert all(one["times"] == one["steps_per_s"] / 15.0 > 0 for one in found.values())


def test_a_missed_promise_is_told_and_none_is_made_without_the_compiler(monkeypatch, capsys):
    slow = {"steps_per_s": 15.0, "times": 1.0, "start_s": 0.0, "steps_per_episode": 1.0}
    fast = slow | {"times": 100.0}
    monkeypatch.setattr(deepracer, "rows", lambda steps: {"a": slow, "b": fast, "interpreted, a": slow})
    monkeypatch.setattr(deepracer, "pin_to_one_core", lambda: None)
    assert deepracer.main([]) == 1
    assert capsys.readouterr().err == "missed: a: 1 times a container's speed, not 100\n"
    monkeypatch.setattr(deepracer, "rows", lambda steps: {"b": fast, "interpreted, a": slow})
    assert deepracer.main(["--json"]) == 0
