"""Names that the house gives are shown in the reader's language; everybody else's stay as they are."""

from __future__ import annotations

import pytest
from django.utils import translation

from league.models import Round, Season
from league.seasons.services.demo_season import open_demo_season
from races.models import Race, RaceKind
from races.web.names import named, names_track


@pytest.mark.django_db
def test_names_of_a_fresh_installation_are_translated(now):
    open_demo_season(now=now)
    texts = [race.description for race in Race.objects.filter(kind=RaceKind.COMMUNITY)]
    texts += [race.name for race in Race.objects.all()]
    texts += [season.name for season in Season.objects.all()] + [round_.name for round_ in Round.objects.all()]
    with translation.override("ko"):
        english = [text for text in texts if text and named(text) == text]
    assert len(texts) > 70 and not english
    with translation.override("en"):
        assert [named(text) for text in texts] == texts


@pytest.mark.parametrize(
    ("name", "korean"),
    [
        ("November · Kuei Raceway", "11월 · Kuei Raceway"),
        ("November pro · Cosmic Circuit", "11월 프로 · Cosmic Circuit"),
        ("March finale · A · B", "3월 결승 · A · B"),
        ("Season 2026-27", "2026-27 시즌"),
        ("Season 2027 · championship", "2027 시즌 · 챔피언십"),
        ("November rain", "November rain"),
        ("Races", "Races"),
        ("First laps on the oval and beyond", "First laps on the oval and beyond"),
        ("", ""),
    ],
)
def test_a_name_is_assembled_from_its_parts(name, korean):
    with translation.override("ko"):
        assert named(name) == korean
    with translation.override("en"):
        assert named(name) == name


def test_a_name_that_contains_the_track_does_not_repeat_it():
    assert names_track("December · Cosmic Loop", "Cosmic Loop")
    assert not names_track("No second chance", "Cosmic Loop")
