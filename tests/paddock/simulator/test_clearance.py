"""Near the centre line nobody has to look whether a wheel is on the road, and nothing changes by not looking."""

from __future__ import annotations

import math
import random

import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import read_npy
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules
from paddock.simulator import stage
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.progress import clear_distance
from paddock.simulator.race import Entrant, RaceSettings, run_race
from tests.shared import SHARED, needs_shared


def assert_clear(track: TrackGeometry) -> None:
    """Every point within the clear distance of the centre line is on the road."""
    clear_m = clear_distance(track)
    draw = random.Random(4)
    for _ in range(500):
        x, y, _ = track.point_at(draw.uniform(0.0, track.length))
        turn, away = draw.uniform(0.0, math.tau), 0.999 * clear_m * draw.uniform(0.8, 1.0)
        assert track.on_road(x + away * math.cos(turn), y + away * math.sin(turn))


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_all_points_within_the_clear_distance_are_road(entry) -> None:
    track = entry.geometry()

    assert_clear(track)
    # straight pieces of border between Kuei's few waypoints cut into its hairpins
    share = 0.7 if entry.slug.startswith("kuei") else 0.8
    assert share * track.width_at(0.0) / 2 < clear_distance(track) < track.width_at(0.0) / 2


@needs_shared
@pytest.mark.parametrize("name", ["caecer_loop", "AWS_track", "thunder_hill_open", "reInvent2019_wide"])
def test_the_clear_distance_holds_on_tracks_of_uneven_width(name: str) -> None:
    assert_clear(read_npy((SHARED / "tracks" / f"{name}.npy").read_bytes(), name))


@pytest.mark.parametrize("offset", [0.0, 0.4, 0.62])
def test_the_shortcut_does_not_change_the_trace(offset: float, monkeypatch: pytest.MonkeyPatch) -> None:
    track = next(entry for entry in CATALOGUE if entry.slug == "oval").geometry()

    def trace() -> str:
        pilot = CentreLinePilot(track, speed=1.5, offset=offset)
        rules = RaceRules(laps=1, max_simulated_ms=30_000)
        return run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)])).trace.sha256

    quick = trace()
    monkeypatch.setattr(stage, "clear_distance", lambda _: 0.0)

    assert trace() == quick
