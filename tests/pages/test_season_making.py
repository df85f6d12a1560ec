"""A season is made from one form, and previewed first."""

from __future__ import annotations

from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest
from django.contrib.admin.models import LogEntry
from django.test import Client

from league.models import Round, Season, Stage
from league.seasons.forms.season_form import SeasonForm
from league.seasons.services.demo_season import open_demo_season
from tests.clients import logged_in
from tests.factories import a_racer, a_track
from tests.league.seasons import JANUARY, a_round, a_season

pytestmark = pytest.mark.django_db
TWO_MONTHS = {f"{kind}_{month}": "" for kind in ("open", "pro") for month in range(3, 13)}


def form_data(now: datetime, **changes: object) -> dict[str, object]:
    """What the form sends when an admin changes nothing but ``changes``."""
    form = SeasonForm(now=now)
    data = {}
    for name in form.fields:
        value = form[name].value()
        data[name] = "" if value is None or value is False else value
    return data | changes


def make(client: Client, data: dict[str, object]):
    """Preview the season that a form says, and make it as it was seen; returns the last answer."""
    seen = client.post("/seasons/new/", data)
    if seen.status_code != 200:
        return seen
    assert not Season.objects.filter(slug=data["slug"]).exists(), "it is looked at before it is made"
    return client.post("/seasons/new/", data | {"seen": seen.context["form"]["seen"].value(), "do": "make"})


class TestSeasonForm:
    def test_one_post_schedules_a_whole_season(self, set_clock):
        now = datetime(2026, 11, 15, 12, tzinfo=UTC)
        set_clock(now)
        a_track()
        admin = a_racer("boss", is_staff=True, is_superuser=True)
        client = logged_in(admin)
        assert client.get("/seasons/new/").status_code == 200
        answer = make(client, form_data(now, zone="Asia/Seoul", drop_worst="2", prizes="A mug"))
        assert answer.status_code == 302, answer.context["form"].errors
        season = Season.objects.get()
        assert answer["Location"] == season.get_absolute_url() == "/seasons/2027/"
        stages = list(season.rounds.values_list("stage", flat=True))
        assert {stage: stages.count(stage) for stage in set(stages)} == {
            "open-qualifier": 12,
            "pro-qualifier": 12,
            "pro-finale": 12,
            "championship": 1,
        }
        seoul = ZoneInfo("Asia/Seoul")
        march = season.rounds.get(number=3, stage=Stage.OPEN).race
        assert march.opens_at == datetime(2027, 3, 1, tzinfo=seoul) and march.closes_at == datetime(
            2027, 4, 1, tzinfo=seoul
        )
        finale = season.rounds.get(number=3, stage=Stage.FINALE).race
        assert finale.opens_at == datetime(2027, 4, 10, 18, tzinfo=seoul)
        assert finale.ranking_method == "total" and finale.max_submissions is None
        final = season.rounds.get(stage=Stage.CHAMPIONSHIP).race
        assert final.opens_at == datetime(2028, 1, 18, 18, tzinfo=seoul) and season.ends_on == final.closes_at.date()
        assert season.drop_worst == 2 and season.prizes == "A mug"
        assert "37 races" in LogEntry.objects.get(user=admin).change_message

    @pytest.mark.slow
    def test_the_proposed_values_work_beside_the_demo_season(self, set_clock):
        now = datetime(2026, 11, 15, 12, tzinfo=UTC)
        set_clock(now)
        open_demo_season(now=now)
        answer = make(logged_in(a_racer("boss", is_staff=True, is_superuser=True)), form_data(now))
        assert answer.status_code == 302, answer.context["form"].errors
        assert Season.objects.get(slug="2027").rounds.count() == 37

    def test_past_months_are_left_out(self, set_clock):
        now = datetime(2027, 10, 15, 12, tzinfo=UTC)
        set_clock(now)
        a_track()
        client = logged_in(a_racer("boss", is_staff=True, is_superuser=True))
        assert make(client, form_data(now, year="2027")).status_code == 302
        season = Season.objects.get()
        assert season.rounds.filter(stage=Stage.OPEN).count() == 3
        assert season.starts_on.month == 10

    @pytest.mark.parametrize(
        ("changes", "field", "word"),
        [
            ({"promotion_percent": "0"}, "promotion_percent", "share 0 %"),
            ({"promotion_percent": "100"}, "promotion_percent", "share 100 %"),
            ({"points": "5, 9"}, "points", "must not increase"),
            ({"points": "five"}, "points", "whole numbers"),
            ({"championship_places": "17"}, "championship_places", "larger finale"),
            ({"pro_minimum_laps": "9"}, "pro_minimum_laps", ""),
            ({"zone": "Nowhere/Else"}, "zone", ""),
            ({"year": "2020"}, "__all__", "later year"),
            ({f"open_{month}": "" for month in range(1, 13)}, "__all__", "Choose a track"),
            ({"finale_day": "1", "finale_hours": "240", "year": "2040"}, "__all__", "days from now"),
        ],
    )
    def test_invalid_values_are_refused_on_their_field(self, set_clock, changes, field, word):
        now = datetime(2026, 11, 15, 12, tzinfo=UTC)
        set_clock(now)
        a_track()
        answer = logged_in(a_racer("boss", is_staff=True, is_superuser=True)).post(
            "/seasons/new/", form_data(now) | TWO_MONTHS | changes
        )
        assert answer.status_code == 422
        assert word in " ".join(answer.context["form"].errors[field])
        assert not Season.objects.exists() and not Round.objects.exists()

    def test_a_season_address_can_be_used_only_once(self, set_clock):
        season = a_season()
        a_round(season, 1, Stage.OPEN)
        set_clock(JANUARY)
        answer = logged_in(a_racer("boss", is_staff=True, is_superuser=True)).post(
            "/seasons/new/", form_data(JANUARY, slug=season.slug)
        )
        assert "already" in " ".join(answer.context["form"].errors["slug"])

    def test_only_superusers_make_seasons(self):
        assert Client().get("/seasons/new/").status_code == 302
        for racer in (a_racer("member"), a_racer("helper", is_staff=True)):
            assert logged_in(racer).get("/seasons/new/").status_code == 403
