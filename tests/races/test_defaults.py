"""What nobody chose is the same wherever a race is described: one list of defaults, and everything reads it."""

from __future__ import annotations

import dataclasses
from argparse import ArgumentParser
from datetime import timedelta
from typing import Any

import pytest
from django.db.models import Model
from django.utils import timezone

from league.models import Stage, StageRules
from league.seasons.forms.season_form import PROPOSALS as OF_A_SEASON
from paddock.rules.race import PROPOSED_BOTS, PROPOSED_BOXES, RACE_TYPES, RaceRules
from paddock.simulator.envs.configuration import rules_of_episodes
from paddock.simulator.envs.setting import head_to_head, object_avoidance
from races.management.race_options import add_race_options, rules_of
from races.models import Race
from races.pages.forms import RaceForm
from races.rules.layout import race_rules
from tests.factories import a_track
from training.models import TrainingJob
from training.wizard.forms import INITIAL

RULES = {field.name: getattr(RaceRules(), field.name) for field in dataclasses.fields(RaceRules)}
# An episode of an environment is one lap that ends at the first fault: that is what it is for.
OF_AN_EPISODE = {"laps", "max_resets", "max_simulated_ms"}


def agreeing(said: dict[str, Any]) -> dict[str, Any]:
    """Those of the rules that are said, as the one list has them."""
    return {name: RULES[name] for name in said}


def of_model(model: type[Model]) -> dict[str, Any]:
    fields = {field.name: field for field in model._meta.concrete_fields if field.name in RULES}
    return {name: field.get_default() for name, field in fields.items() if name != "boxes"}


def test_a_race_without_settings_has_the_simulators_rules():
    assert race_rules(Race()) == RaceRules()


@pytest.mark.parametrize("model", [Race, StageRules, TrainingJob])
def test_a_model_row_has_the_default_rules(model):
    said = of_model(model)
    assert said and said == agreeing(said)


def test_the_evaluate_command_has_the_default_rules():
    parser = ArgumentParser()
    add_race_options(parser)
    assert rules_of(vars(parser.parse_args([]))) == RaceRules()


@pytest.mark.parametrize("race_type", RACE_TYPES)
def test_the_environments_have_the_default_rules(race_type):
    said = {name: value for name, value in rules_of_episodes(race_type).items() if name not in OF_AN_EPISODE}
    assert said and said == agreeing(said)


def test_environments_and_forms_propose_the_same_layout():
    assert object_avoidance().rules.random_boxes == PROPOSED_BOXES
    assert head_to_head().rules.bots == PROPOSED_BOTS


@pytest.mark.django_db
def test_race_and_training_forms_have_the_default_rules(now):
    for initial in (RaceForm(now=now).initial, INITIAL):
        assert (initial["random_boxes"], initial["bots"]) == (PROPOSED_BOXES, PROPOSED_BOTS)
        said = {name: value for name, value in initial.items() if name in RULES}
        said = {name: value for name, value in said.items() if name not in ("boxes", "random_boxes", "bots")}
        assert said and said == agreeing(said)


def test_open_races_of_a_season_have_the_default_rules():
    """A season lays out its races by turns, and gives learners' slow cars more time: these are its own."""
    said = {name: OF_A_SEASON[Stage.OPEN][name] for name in ("laps", "off_track_penalty_ms")}
    assert said == agreeing(said)


@pytest.mark.django_db
def test_the_api_has_the_default_rules(alice, client):
    a_track()
    now = timezone.now()
    client.force_login(alice)
    sent = {"name": "Friday", "track": "oval", "opens_at": now.isoformat()}
    sent["closes_at"] = (now + timedelta(days=3)).isoformat()
    answer = client.post("/api/v1/races/", sent, content_type="application/json")
    assert answer.status_code == 201, answer.content
    said = {name: value for name, value in answer.json().items() if name in RULES and name != "boxes"}
    assert said and said == agreeing(said)
