"""Cups of the day by a program."""

from __future__ import annotations

from datetime import timedelta

import pytest

from league.models import Cup, CupPlace, CupStarter
from tests.factories import a_model, a_race, a_racer

pytestmark = pytest.mark.django_db
AT = "/api/v1/cups/"


def test_a_cup_is_read_with_its_divisions(client, now):
    race = a_race(now, opens_at=now - timedelta(days=2), closes_at=now - timedelta(days=1))
    cup = Cup.objects.create(day=now.date(), race=race, over_at=now)
    CupPlace.objects.create(cup=cup, division=1, racer=a_racer("won"), place=1, qualified=3)
    listed = client.get(AT).json()["results"]
    assert [(one["day"], one["stage"], one["racers"]) for one in listed] == [(str(cup.day), "over", 1)]
    read = client.get(f"{AT}{cup.day}/").json()
    assert read["divisions"] == [{"number": 1, "race": None, "places": [{"place": 1, "racer": "won", "qualified": 3}]}]
    assert client.get(f"{AT}2020-01-01/").status_code == 404


def test_a_car_is_chosen_to_start_and_given_up(client):
    racer = a_racer()
    model = a_model(racer)
    assert client.get(f"{AT}starter/").status_code == 401
    client.force_login(racer)
    assert client.get(f"{AT}starter/").status_code == 404
    sent = client.put(f"{AT}starter/", {"model": model.public_id}, content_type="application/json")
    assert (sent.status_code, sent.json()["model"]) == (200, model.public_id)
    assert client.get(f"{AT}starter/").json()["name"] == model.name
    assert client.delete(f"{AT}starter/").status_code == 204
    assert not CupStarter.objects.exists()


@pytest.mark.parametrize(("body", "status"), [({}, 400), ({"model": "none"}, 404), ({"model": "x", "more": 1}, 400)])
def test_a_senseless_choice_changes_nothing(client, body, status):
    client.force_login(a_racer())
    assert client.put(f"{AT}starter/", body, content_type="application/json").status_code == status
    assert not CupStarter.objects.exists()
