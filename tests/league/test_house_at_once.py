"""Two schedulers send the house cars at the same time."""

from __future__ import annotations

from collections import Counter
from datetime import timedelta

import pytest

from league.house_cars.services import enter_house_cars
from league.seasons.services.demo_season import open_demo_season
from races.models import Submission
from tests.league.test_demo_season import stable as stable
from tests.races.test_concurrency import at_once


@pytest.mark.django_db(transaction=True)
def test_each_house_car_enters_a_race_once(now, stable, wakes):
    open_demo_season(now=now)
    first, later = enter_house_cars(now=now, folder=stable), now + timedelta(days=31)
    answers = at_once([lambda: enter_house_cars(now=later, folder=stable)] * 4)
    assert sum(answers) == Submission.objects.count() - first > 0, answers
    assert set(Counter(Submission.objects.values_list("entry__race", "entry__racer")).values()) == {1}
