"""Terms of a race through the API."""

from __future__ import annotations

from datetime import timedelta

import pytest

from races.pages.services import edit_race
from tests.factories import a_model, a_race

pytestmark = pytest.mark.django_db


def test_the_api_refuses_without_and_takes_with(alice, bob, now, as_racer):
    terms = {"prize": "A model car", "sponsor": "Wheels Ltd.", "terms": "Be kind."}
    race = edit_race(race=a_race(now, organiser=alice, closes_at=now + timedelta(days=300)), now=now, **terms)
    shown = as_racer(bob).get(f"/api/v1/races/{race.slug}/").data
    assert (shown["prize"], shown["sponsor"], shown["terms_version"]) == ("A model car", "Wheels Ltd.", 1)
    assert shown["terms"] == "Be kind."
    address = f"/api/v1/races/{race.slug}/entry/"
    answer = as_racer(bob).post(address)
    assert (answer.status_code, answer.data["code"]) == (403, "race_terms")
    answer = as_racer(bob).post(address, {"terms": 1}, format="json")
    assert answer.data["accepted_terms"]["version"] == 1
    answer = as_racer(alice).patch(f"/api/v1/races/{race.slug}/", {"terms": "Other words."}, format="json")
    assert answer.data["terms_version"] == 2
    sent = {"model": a_model(bob).public_id}
    address = f"/api/v1/races/{race.slug}/submissions/"
    assert as_racer(bob).post(address, sent, format="json").data["code"] == "race_terms"
    assert as_racer(bob).post(address, {**sent, "terms": 2}, format="json").status_code == 201
