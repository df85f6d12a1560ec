"""Duels for real: house cars go through upload, qualifying, the draw and every heat, each in its own sandbox."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from io import BytesIO

import pytest
from django.utils import timezone

from evaluation.garage.services import upload_model
from evaluation.models import Evaluation, State
from evaluation.running.queue.worker import run_next_evaluation
from league.house_cars.services import HouseCar, house_cars
from paddock.packages.read import UploadPart
from races.boards.selectors.board import board
from races.duels.selectors import duels_of
from races.duels.services import drive_all_on
from races.entries.services.submissions import submit_model
from races.models import Draw, Duel, DuelState, Entry, Race
from tests.duels import a_duel_race
from tests.factories import a_racer

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True)]


def upload(car: HouseCar, owner, now):
    files = [
        UploadPart(f"{car.name}.onnx", BytesIO(car.onnx.read_bytes())),
        UploadPart("model_metadata.json", BytesIO(car.metadata.read_bytes())),
    ]
    return upload_model(owner=owner, files=files, now=now).model


def work_off() -> int:
    count = 0
    while run_next_evaluation(worker="test"):
        count += 1
    return count


@pytest.fixture
def qualified() -> Race:
    """A race whose qualifying three house cars have driven."""
    now = timezone.now()
    race = a_duel_race(now, laps=1)
    for car in house_cars()[:3]:
        racer = a_racer(car.name)
        submit_model(race=race, racer=racer, model=upload(car, racer, now), now=now)
    assert work_off() == 3
    assert set(Entry.objects.values_list("classified", flat=True)) == {True}
    return race


def decided(race: Race) -> Iterator[Duel]:
    return Duel.objects.filter(race=race, state=DuelState.DECIDED).select_related("evaluation__result").iterator()


@pytest.mark.parametrize(
    ("options", "heats"),
    [
        ({}, 6),
        pytest.param({"duel_cars": 3}, 6, marks=pytest.mark.soak),
        pytest.param({"duel_format": "bracket"}, 4, marks=pytest.mark.soak),
    ],
)
def test_three_cars_drive_all_their_duels(qualified, options, heats):
    race = qualified
    Race.objects.filter(pk=race.pk).update(**options)
    race.refresh_from_db()
    later = race.closes_at + timedelta(seconds=1)
    assert drive_all_on(now=later) > 0
    assert work_off() == heats, "each round is queued by the last result of the one before"
    assert Draw.objects.get(race=race).over_at is not None
    assert drive_all_on(now=later) == 0
    driven = list(decided(race))
    assert len(driven) == heats and set(Evaluation.objects.values_list("state", flat=True)) == {State.FINISHED}
    for duel in driven:
        cars = list(duel.cars.order_by("grid"))
        result = duel.evaluation.result
        assert sorted(result.order) == list(range(len(cars)))
        assert result.rivals.count() == len(cars) - 1
        for place, number in enumerate(result.order, start=1):
            assert cars[number].place == place, "nobody retires here"
        assert sum(car.points for car in cars) == sum(range(len(cars)))
        assert all(car.laps == 1 and car.time_ms > 0 for car in cars), "these cars lap without fail"
    rows = board(race).rows
    keys = [(-row.entry.points, row.entry.duel_lap_ms, row.entry.seed) for row in rows]
    assert keys == sorted(keys) and [row.rank for row in rows] == [1, 2, 3]
    assert duels_of(race).is_over


def test_the_same_duels_produce_the_same_results(qualified):
    race = qualified
    drive_all_on(now=race.closes_at + timedelta(seconds=1))
    work_off()
    duel = Duel.objects.filter(race=race).select_related("evaluation__result").first()
    first = duel.evaluation.result
    Duel.objects.filter(pk=duel.pk).update(evaluation=None)  # as it would be repeated
    copy = Evaluation.objects.get(pk=first.evaluation_id)
    rivals = list(copy.rivals.all())
    copy.pk, copy.public_id, copy.state, copy.ended_at, copy.started_at = None, "again2345678", State.QUEUED, None, None
    copy.save(force_insert=True)
    for rival in rivals:
        rival.pk, rival.evaluation = None, copy
        rival.save(force_insert=True)
    assert work_off() == 1
    copy.refresh_from_db()
    again = copy.result
    assert again.trace_sha256 == first.trace_sha256
    hashes = [list(one.rivals.order_by("number").values_list("trace_sha256", flat=True)) for one in (first, again)]
    assert hashes[0] == hashes[1] and again.order == first.order
