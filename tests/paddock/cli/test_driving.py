"""What is driven at home: the site's own track where the package has none such; nothing where something is amiss."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from paddock.cli import driving
from paddock.cli.driving import Where, driven, where_of
from paddock.cli.showing import Speaker, lap_time, table
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

OVAL = by_slug("oval").geometry()
WIDER = TrackGeometry.from_arrays("Wider", OVAL.centre * 1.25, OVAL.inner * 1.25, OVAL.outer * 1.25)
OPEN = by_slug("straight-track").geometry()


class SiteOf:
    """Answers for one track, by way of JSON, and notes what it is asked."""

    def __init__(self, track: TrackGeometry) -> None:
        self.track, self.asked = track, []

    def get(self, path: str) -> Any:
        self.asked.append(path)
        return json.loads(json.dumps(self.track.to_dict()))


def told(track: TrackGeometry, **rules: Any) -> dict[str, Any]:
    about = {"slug": "it", "fingerprint": track.fingerprint, "look": "official"}
    return {"engine": "paddock-v3", "track": about, "rules": {**RaceRules(direction="cw").to_dict(), **rules}}


def test_a_track_of_the_catalogue_is_not_fetched():
    site = SiteOf(OVAL)
    where = where_of(site, told(OVAL))
    assert where.track.direction == "cw" and where.track == OVAL.in_direction("cw") and site.asked == []


@pytest.mark.parametrize("track", [WIDER, OPEN], ids=["closed", "open"])
def test_a_track_of_the_sites_own_is_fetched_to_the_last_bit(track, monkeypatch):
    monkeypatch.setattr(driving, "CATALOGUE", ())
    site = SiteOf(track)
    where = where_of(site, told(track))
    assert site.asked == ["/tracks/it/"] and where.track.is_open == track.is_open
    assert np.array_equal(where.track.in_direction(track.direction).centre, track.centre)


def test_points_of_another_track_are_not_driven():
    with pytest.raises(UserFault) as caught:
        where_of(SiteOf(OPEN), told(WIDER))
    assert caught.value.code == "track_differs"


@pytest.mark.parametrize("rules", [{"wings": 2}, {"laps": 0}, {"boxes": [{"fraction": 2}]}, {"direction": "up"}])
def test_rules_of_a_later_version_are_said(rules):
    with pytest.raises(UserFault) as caught:
        where_of(SiteOf(OVAL), told(OVAL, **rules))
    assert caught.value.code == "rules_unknown"


@pytest.mark.parametrize("rules", [{"laps": 10**9}, {"max_simulated_ms": 10**12}, {"seed": 10**40}])
def test_rules_that_would_drive_for_weeks_are_refused(rules):
    with pytest.raises(UserFault) as caught:
        where_of(SiteOf(OVAL), told(OVAL, **rules))
    assert caught.value.code == "rules_unknown"


def test_a_process_that_dies_is_said(monkeypatch):
    monkeypatch.setattr(driving, "CHILD", "paddock.cli.nothing_of_the_kind")
    with (
        pytest.raises(PlatformFault) as caught,
        driven(Where(OVAL, "official", RaceRules()), Speaker(True), cars=[]) as _,
    ):
        raise AssertionError("Nothing was run")
    assert caught.value.code == "drive_failed" and "nothing_of_the_kind" in str(caught.value)


def test_tables_and_times_are_those_of_the_site():
    assert [lap_time(ms) for ms in (None, 0, 7_148, 61_002, 600_000)] == [
        "-", "0:00.000", "0:07.148", "1:01.002", "10:00.000",
    ]  # fmt: skip
    assert table(("rank", "racer"), [(1, "ayrton"), ("-", "niki")]) == "rank  racer\n   1  ayrton\n   -  niki"
    assert table(("rank", "racer"), []) == "rank  racer"
