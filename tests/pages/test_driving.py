"""The page on which a visitor drives: its setup and the ghosts it offers."""

from __future__ import annotations

import json
from datetime import timedelta
from html import unescape

import pytest
from django.test import Client

from paddock.geometry.track import CCW, CW
from paddock.simulator.physics import PADDOCK_CAR
from races.driving.views import ghosts_on
from races.models import Race
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture
def race(now) -> Race:
    return a_race(now)


def test_the_page_has_the_physics_of_the_simulator_and_the_penalty_of_the_rules(client: Client, race: Race):
    page = client.get(f"/tracks/{race.track.slug}/drive/").content.decode()
    setup = json.loads(unescape(page.split('data-drive="')[1].split('"')[0]))
    assert setup["physics"]["curvature_limit"] == PADDOCK_CAR.curvature_limit
    assert setup["physics"]["steering_dead_ticks"] == PADDOCK_CAR.steering_dead_ticks
    assert setup["penalty_ms"] == 2000
    assert client.get(setup["scene"]).json()["closed"]


def test_ghosts_are_the_fastest_run_of_each_racer_in_the_direction(client: Client, race: Race, now):
    alice, bob = a_racer("alice"), a_racer("bob")
    a_driven_run(race, alice, now - timedelta(hours=2), lap_ms=3_000)
    fast = a_driven_run(race, alice, now - timedelta(hours=1), lap_ms=2_000)
    other = a_driven_run(race, bob, now, lap_ms=2_500)
    found = ghosts_on(race.track, CCW, bob)
    assert [(ghost.run, ghost.lap) for ghost in found] == [(fast, 2), (other, 2)]
    assert not ghosts_on(race.track, CW, bob)
    assert not ghosts_on(race.track, CCW, bob, hidden=[race.pk])
    page = client.get(f"/tracks/{race.track.slug}/drive/?ghost={other.public_id}").content.decode()
    assert f'/evaluations/{other.public_id}/replay.json" data-lap="2"\n        selected' in page


def test_a_run_that_a_visitor_may_not_see_is_no_ghost(client: Client, now):
    alice = a_racer("alice")
    race = a_race(now, visibility="invitation", organiser=alice)
    a_driven_run(race, alice, now)
    assert ghosts_on(race.track, CCW, alice)
    assert not ghosts_on(race.track, CCW, a_racer("zoe"))


@pytest.mark.parametrize("address", ["/tracks/nowhere/drive/", "/tracks/oval/drive/?direction=up"])
def test_there_is_no_page_for_an_unknown_track_or_direction(client: Client, race: Race, address: str):
    assert race.track.slug == "oval"
    assert client.get(address).status_code == 404


def test_the_track_page_leads_to_it(client: Client, race: Race):
    assert f'href="/tracks/{race.track.slug}/drive/"' in client.get(race.track.get_absolute_url()).content.decode()
