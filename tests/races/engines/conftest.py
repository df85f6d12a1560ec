"""A race of three cars that one engine drove, and a site that gets another."""

from __future__ import annotations

import pytest

from races.entries.services.redrives import sweep_redrives
from races.models import Race
from tests.factories import a_race, a_racer, drive, laps
from tests.redrives import SITE

from .site import NEW, OLD


@pytest.fixture
def site(monkeypatch):
    """``site(engine)``: from now on this site drives with it. Before that, with the old one."""

    def upgrade(engine: str) -> None:
        monkeypatch.setattr(SITE, engine)

    upgrade(OLD)
    return upgrade


@pytest.fixture
def cast(site):
    return [a_racer(name) for name in ("ann", "bob", "cat")]


@pytest.fixture
def race(cast, now) -> Race:
    """An open race: ann has 10 s, bob 11 s, and cat 12 s."""
    race = a_race(now)
    for number, racer in enumerate(cast):
        drive(race, racer, laps(*[10_000 + 1000 * number] * 3), now)
    race.refresh_from_db()
    return race


@pytest.fixture
def upgraded(race, site, now) -> Race:
    """The same on a site with the new engine, whose sweep has queued the three runs."""
    site(NEW)
    assert sweep_redrives(now=now) == 3
    return race
