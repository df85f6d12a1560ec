"""House cars as what racers measure themselves by."""

from __future__ import annotations

import pytest

from races.boards.selectors.board import podiums, to_beat
from tests.factories import a_race
from tests.races.test_boards import many_entries

pytestmark = pytest.mark.django_db


def test_house_cars_are_to_beat_until_a_racer_is_classified(now, django_assert_num_queries):
    led, house_only, empty = (a_race(now) for _ in range(3))
    many_entries(led, 1, now, baselines=1)
    entries = many_entries(house_only, 0, now, baselines=2, unclassified=1)
    found = podiums([led, house_only, empty])
    with django_assert_num_queries(1):
        best = to_beat(found)
    assert set(best) == {house_only.pk}
    assert [car.score_ms for car in best[house_only.pk]] == sorted(
        entry.score_ms for entry in entries if entry.is_baseline
    )
    with django_assert_num_queries(0):
        assert to_beat(podiums([])) == {} and to_beat({led.pk: found[led.pk]}) == {}
