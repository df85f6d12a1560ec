"""A race of three cars that one engine drove, and a site that gets another."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

import pytest

from accounts.models import Racer
from races.entries.services.redrives import sweep_redrives
from races.models import Race
from tests.factories import a_race, a_racer, drive, laps
from tests.kept import Kept
from tests.redrives import SITE

from .site import NEW, OLD

NAMES = ("ann", "bob", "cat")


@pytest.fixture
def site(monkeypatch):
    """``site(engine)``: from now on this site drives with it. Before that, with the old one."""

    def upgrade(engine: str) -> None:
        monkeypatch.setattr(SITE, engine)

    upgrade(OLD)
    return upgrade


@pytest.fixture
def cast(site) -> list[Racer]:
    return list(Racer.objects.filter(alias__in=NAMES).order_by("alias")) or [a_racer(name) for name in NAMES]


@pytest.fixture(scope="session")
def kept_old_race(request: pytest.FixtureRequest, keep: Callable, now: datetime) -> Kept:
    return keep(request, lambda: _race(now))


@pytest.fixture
def race(kept_old_race: Kept, db: None, site) -> Race:
    return kept_old_race.copy()


def _race(now: datetime) -> Race:
    """An open race: ann has 10 s, bob 11 s, and cat 12 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SITE, OLD)
        race = a_race(now)
        for number, name in enumerate(NAMES):
            drive(race, a_racer(name), laps(*[10_000 + 1000 * number] * 3), now)
    race.refresh_from_db()
    return race


@pytest.fixture
def upgraded(race, site, now) -> Race:
    """The same on a site with the new engine, whose sweep has queued the three runs."""
    site(NEW)
    assert sweep_redrives(now=now) == 3
    return race
