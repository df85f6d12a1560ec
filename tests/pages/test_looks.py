"""Cars in their shells and colours, and what the card of a race says before a racer is classified."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from evaluation.appearance.shells import FROM_ABOVE
from evaluation.models import Evaluation, TrainedModel
from tests.duels import drawn, driving, end
from tests.factories import a_race, a_racer, drive, laps
from tests.pages.conftest import World


def cars_of(run: Evaluation) -> dict[int, tuple[str, str]]:
    """The cars that a replay draws by number: the colour and the body's path of each."""
    document = Client().get(f"{run.get_absolute_url()}replay.json").json()
    return {
        car["number"]: re.search(r'above-body" fill="([^"]+)" d="([^"]+)"', car["look"]["above"]).groups()
        for car in (document, *document["rivals"])
    }


@pytest.mark.django_db
def test_a_replay_shows_the_shell_and_colour_of_the_model():
    now = timezone.now()
    racer = a_racer("alice")
    evaluation = drive(a_race(now), racer, laps(11_000, 12_000, 13_000), now).evaluation
    TrainedModel.objects.filter(pk=evaluation.model_id).update(shell="kart", colour="#a3e635")
    html = Client().get(evaluation.get_absolute_url()).content.decode()
    assert cars_of(evaluation) == {0: ("#a3e635", FROM_ABOVE["kart"].body)}
    assert "style=" not in html.split("data-stage")[1].split("</svg>")[0], "the content policy lets no style in"


@pytest.mark.django_db(transaction=True)
def test_identical_looking_cars_of_a_duel_are_told_apart(monkeypatch):
    now = timezone.now()
    race = drawn(now - timedelta(hours=2), 2)
    (duel,) = driving(race)
    end(duel, now)
    html = Client().get(duel.evaluation.get_absolute_url()).content.decode()
    cars = cars_of(duel.evaluation)
    assert set(cars) == {0, 1}
    assert cars[0][0] == "#3b82f6" != cars[1][0]
    samples = re.findall(r'class="car-sample">.*?shell-body" fill="([^"]+)"', html, re.S)
    assert set(samples) == {cars[0][0], cars[1][0]}, "table and legend show the same colours"


def test_the_owner_changes_a_models_look_by_page_and_api(world: World):
    model = TrainedModel.objects.filter(owner=world.alice, deleted_at=None).first()
    client = world.client("alice")
    path = f"/models/{model.public_id}/edit/"
    page = client.get(path).content.decode()
    assert page.count('class="shell-body"') == 12
    sent = {"name": model.name, "description": "", "shell": "wedge", "colour": "#FF8800"}
    assert client.post(path, sent).status_code == 302
    model.refresh_from_db()
    assert model.look == ("wedge", "#ff8800")
    assert client.post(path, {**sent, "colour": "red"}).status_code == 422
    assert client.post(path, {"name": model.name}).status_code == 302  # without a look, it stays
    api = f"/api/v1/models/{model.public_id}/"
    answer = client.patch(api, {"shell": "rover"}, content_type="application/json")
    assert (answer.json()["shell"], answer.json()["colour"]) == ("rover", "#ff8800")
    refused = client.patch(api, {"shell": "tank"}, content_type="application/json")
    assert (refused.status_code, refused.json()["code"]) == (400, "model_look")


@pytest.mark.django_db
def test_a_card_names_the_house_car_to_beat_at_first():
    now = timezone.now()
    race = a_race(now)
    assert "Be first on the board" in Client().get("/races/").content.decode()
    drive(race, a_racer("Flyer", is_house=True), laps(9_000, 9_000, 9_000), now)
    html = Client().get("/races/").content.decode()
    assert "Be first on the board. House cars to beat:" in " ".join(html.split()) and "0:09.000" in html
    drive(race, a_racer("alice"), laps(11_000, 11_000, 11_000), now)
    assert "House cars to beat" not in Client().get("/races/").content.decode()
