"""Duels whose heats another engine drove."""

from __future__ import annotations

import pytest

from evaluation.models import Evaluation
from paddock.errors import UserFault
from races.duels.services import draw_duels, drive_all_on, drive_on
from races.entries.services.redrives import sweep_redrives
from races.models import Draw, Duel, DuelState, Entry
from tests.duels import a_duel_race, driving, end_all, qualify, ranking
from tests.duels import end as end_heat
from tests.redrives import everything, shown

from .site import NEW, again

pytestmark = pytest.mark.django_db


class TestDuels:
    def test_a_draw_waits_until_qualifying_is_redriven(self, cast, site, now):
        race = a_duel_race(now)
        qualify(race, cast, now)
        site(NEW)
        with pytest.raises(UserFault) as refused:
            draw_duels(race=race, now=race.closes_at)
        assert refused.value.code == "duels_wait_for_qualifying"
        assert drive_all_on(now=race.closes_at) == 0
        assert sweep_redrives(now=race.closes_at) == 3
        assert drive_all_on(now=race.closes_at) == 0
        again(race, race.closes_at, 10_300, 10_200, 10_100)
        sweep_redrives(now=race.closes_at)
        assert drive_all_on(now=race.closes_at) > 0
        assert list(Entry.objects.order_by("seed").values_list("racer__alias", flat=True)) == ["cat", "bob", "ann"]

    @pytest.mark.parametrize("duel_format", ["round_robin", "bracket"])
    def test_heats_in_progress_are_undone_and_drawn_again(self, cast, site, now, commits, duel_format):
        race = a_duel_race(now, duel_format=duel_format)
        qualify(race, cast, now)
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
        heats = driving(race)
        end_heat(heats[0], race.closes_at)
        site(NEW)
        under_way = [one.evaluation_id for one in driving(race)]
        assert under_way
        assert sweep_redrives(now=race.closes_at) == 3
        assert not Draw.objects.exists() and not Duel.objects.exists()
        assert shown(race) == [("ann", 10_000), ("bob", 10_100), ("cat", 10_200)]
        assert set(Evaluation.objects.filter(pk__in=under_way).values_list("state", flat=True)) == {"stopped"}
        again(race, race.closes_at, 10_300, 10_200, 10_100)
        drive_all_on(now=race.closes_at)
        end_all(race, race.closes_at)
        assert Draw.objects.get().over_at is not None
        assert ranking(race) == ["cat", "bob", "ann"]
        assert set(Duel.objects.exclude(evaluation=None).values_list("evaluation__result__engine", flat=True)) == {NEW}
        assert sweep_redrives(now=race.closes_at) == 0

    def test_a_heat_driven_by_another_engine_does_not_count(self, cast, site, now, commits):
        race = a_duel_race(now)
        qualify(race, cast[:2], now)
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
        (heat, *_) = driving(race)
        site(NEW)
        end_heat(heat, race.closes_at)
        heat.refresh_from_db()
        assert (heat.state, heat.tries) == (DuelState.WAITING, 0)
        assert drive_on(race=race, now=race.closes_at) == 0
        assert sweep_redrives(now=race.closes_at) == 2

    def test_finished_duels_keep_their_engine(self, cast, site, now, commits):
        race = a_duel_race(now)
        qualify(race, cast, now)
        drive_all_on(now=race.closes_at)
        end_all(race, race.closes_at)
        before = everything(race)
        site(NEW)
        assert sweep_redrives(now=race.closes_at) == 0
        assert everything(race) == before
