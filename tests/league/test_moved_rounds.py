"""A round's race that is moved is held to what it was held to when it was scheduled."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.exceptions import ValidationError

from races.errors import RaceRefused
from races.pages.services import cancel_race, edit_race
from tests.league.seasons import HOUR, JANUARY, MONTH, a_round

pytestmark = pytest.mark.django_db
NOW = JANUARY - timedelta(days=1)


def refusal(round_, **changes) -> tuple[str, str]:
    """The code and the field of a refused change; the race stays as it was."""
    before = (round_.race.opens_at, round_.race.closes_at)
    with pytest.raises(RaceRefused) as caught:
        edit_race(race=round_.race, now=NOW, **changes)
    round_.race.refresh_from_db()
    assert (round_.race.opens_at, round_.race.closes_at) == before
    (field,) = caught.value.errors.error_dict
    return caught.value.code, field


def test_rounds_of_a_stage_cannot_be_made_to_overlap(season):
    first, second = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    assert refusal(first, closes_at=second.race.opens_at + HOUR) == ("rounds_overlap", "closes_at")
    assert refusal(second, opens_at=first.race.closes_at - HOUR) == ("rounds_overlap", "opens_at")
    edit_race(race=second.race, now=NOW, opens_at=second.race.opens_at + HOUR)
    edit_race(race=first.race, now=NOW, closes_at=second.race.opens_at)
    assert first.race.closes_at == second.race.opens_at, "one may begin when the other ends"


def test_rounds_of_different_stages_may_overlap(season):
    open_, pro = a_round(season, 1, "open-qualifier"), a_round(season, 1, "pro-qualifier")
    one, other = a_round(season, 3, "single"), a_round(season, 4, "single")
    edit_race(race=pro.race, now=NOW, closes_at=pro.race.closes_at + HOUR)
    edit_race(race=open_.race, now=NOW, closes_at=open_.race.closes_at + MONTH)
    edit_race(race=one.race, now=NOW, closes_at=other.race.closes_at)


def test_a_finale_cannot_start_before_its_qualifier_closes(season):
    pro, finale = a_round(season, 1, "pro-qualifier"), a_round(season, 1, "pro-finale")
    assert refusal(finale, opens_at=pro.race.closes_at - HOUR) == ("finale_before_qualifier", "opens_at")
    assert refusal(pro, closes_at=finale.race.opens_at + HOUR) == ("finale_before_qualifier", "closes_at")
    edit_race(race=finale.race, now=NOW, opens_at=pro.race.closes_at)
    edit_race(race=finale.race, now=NOW, description="Of January.")


def test_a_qualifier_cannot_be_scheduled_after_its_finale(season):
    finale = a_round(season, 1, "pro-finale")
    with pytest.raises(ValidationError) as caught:
        a_round(season, 1, "pro-qualifier", closes_at=finale.race.opens_at + HOUR)
    assert caught.value.error_dict["race"][0].code == "finale_before_qualifier"


def test_a_cancelled_round_blocks_no_other(season):
    first, second = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    cancel_race(race=second.race, reason="No track.", now=NOW)
    edit_race(race=first.race, now=NOW, closes_at=second.race.closes_at)
    pro, finale = a_round(season, 1, "pro-qualifier"), a_round(season, 1, "pro-finale")
    cancel_race(race=finale.race, reason="No time.", now=NOW)
    edit_race(race=pro.race, now=NOW, closes_at=finale.race.closes_at)
