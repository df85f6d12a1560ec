"""Any recorded season, drawn at random, keeps the rules of the league."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from django.db import transaction
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from league.history.proof import proof_of
from league.history.season_export import export_season
from league.models import (
    ChampionshipPlace,
    FinalePlace,
    Membership,
    RoundPoints,
    Season,
)
from league.standings.rules import Promotion
from races.boards.selectors.board import board
from races.models import Entry
from tests.league.histories import random_season, read_csv, write_csv, write_season
from tests.league.records import bring, contents, everything
from tests.soak import examples

pytestmark = pytest.mark.django_db


@settings(
    max_examples=examples(15),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(seed=st.integers(0, 2**32), percent=st.integers(1, 99), size=st.integers(1, 12), places=st.integers(1, 12))
def test_any_imported_season_keeps_the_rules(db, seed, percent, size, places):
    numbers = {"promotion_percent": percent, "finale_size": size, "championship_places": min(places, size)}
    races = random_season(seed)
    with TemporaryDirectory() as name, transaction.atomic():
        folder = write_season(Path(name) / "in", races)
        (season,) = bring(folder, **numbers)
        before = everything()
        _check_rules(season)
        proof = proof_of(season)
        assert proof["order"]["pairs"] == proof["order"]["agree"]
        assert proof["results"] == sum(len(race.scores) for race in races)
        bring(folder, **numbers)
        assert everything() == before, "importing twice changes nothing"
        export_season(season=season, folder=Path(name) / "out")
        assert contents(Path(name) / "out") == contents(folder)
        outcome = _outcome(season)
        transaction.set_rollback(True)
    # the same results in any other order of rows are the same season
    with TemporaryDirectory() as name, transaction.atomic():
        folder = write_season(Path(name), races)
        for race in races:
            rows = read_csv(folder / race.file)
            if rows:
                write_csv(folder / race.file, list(rows[0]), rows[::-1])
        (season,) = bring(folder, **numbers)
        assert _outcome(season) == outcome
        transaction.set_rollback(True)


def _check_rules(season: Season) -> None:
    promoted = list(Membership.objects.filter(season=season).values_list("racer", flat=True))
    assert len(promoted) == len(set(promoted)), "promoted at most once, and nobody in two divisions"
    for round_ in season.rounds.all():
        classified = Entry.objects.filter(race=round_.race, classified=True).count()
        if round_.stage == "open-qualifier":
            most = Promotion(season.promotion_percent).places(classified)
            earlier = Membership.objects.filter(season=season, since__lt=round_.race.closes_at).values("racer")
            best = [row.entry.racer_id for row in board(round_.race, per_page=1000).rows][:most]
            new = set(best) - set(Membership.objects.filter(racer__in=earlier).values_list("racer", flat=True))
            assert set(round_.promotions.values_list("racer", flat=True)) == new
        elif round_.stage == "pro-qualifier":
            field = list(round_.finale_places.values_list("racer", flat=True))
            qualified = set(
                ChampionshipPlace.objects.filter(
                    season=season, round__race__closes_at__lte=round_.race.closes_at
                ).values_list("racer", flat=True)
            )
            free = Entry.objects.filter(race=round_.race, classified=True).exclude(racer__in=qualified).count()
            assert len(field) == min(season.finale_size, free) and not qualified & set(field)
        elif round_.stage == "pro-finale":
            assert round_.championship_places.count() <= min(season.championship_places, classified)
    finalists = Counter(ChampionshipPlace.objects.filter(season=season).values_list("racer", flat=True))
    assert not finalists or max(finalists.values()) == 1


def _outcome(season: Season) -> dict[str, list]:
    return {
        "pros": sorted(Membership.objects.filter(season=season).values_list("racer__record_id", "place", "since")),
        "fields": sorted(FinalePlace.objects.values_list("round__number", "place", "racer__record_id")),
        "qualified": sorted(ChampionshipPlace.objects.values_list("round__number", "place", "racer__record_id")),
        "points": sorted(RoundPoints.objects.values_list("round__number", "round__stage", "rank", "racer__record_id")),
    }
