"""An open track is driven from its start to its end or back: forms say so, whichever track is chosen."""

from __future__ import annotations

import re

import pytest
from django.test import Client

from tests.factories import a_model, a_race, a_track
from tests.rows import track_row

pytestmark = pytest.mark.django_db


@pytest.fixture
def straight():
    a_track()
    return track_row("straight-track")


def directions(page: str) -> dict[str, str]:
    """What the choice of a direction offers, by its value."""
    (choice,) = re.findall(r'<select name="direction".*?</select>', page, flags=re.S)
    assert 'data-forth="from start to end" data-back="from end to start"' in choice
    options = re.findall(r'<option value="(\w+)"(?: selected)? data-usual="([\w-]+)">(.*?)</option>', choice)
    assert {value: usual for value, usual, _ in options} == {"ccw": "counter-clockwise", "cw": "clockwise"}
    return {value: said for value, _, said in options}


@pytest.fixture
def page(alice):
    client = Client()
    client.force_login(alice)
    a_model(alice)
    return lambda address: client.get(address).content.decode()


def test_the_direction_of_an_open_track_is_told_by_its_ends(page, straight):
    told = directions(page(f"/runs/new/?track={straight.slug}"))
    other = {"ccw": "cw", "cw": "ccw"}[straight.direction]
    assert told == {straight.direction: "from start to end", other: "from end to start"}


def test_the_direction_of_a_loop_is_told_by_the_clock(page, straight):
    assert directions(page("/runs/new/?track=oval")) == {"ccw": "counter-clockwise", "cw": "clockwise"}


def test_a_race_on_an_open_track_is_edited_in_its_words(page, straight, alice, now):
    race = a_race(now, slug="straight", track=straight, organiser=alice)
    assert directions(page(f"/races/{race.slug}/edit/"))[straight.direction] == "from start to end"


def test_every_open_track_tells_its_way_to_the_script(page, straight):
    shown = page("/races/new/")
    assert f'<option value="{straight.slug}" data-open="{straight.direction}">' in shown
    assert '<option value="oval">' in shown
