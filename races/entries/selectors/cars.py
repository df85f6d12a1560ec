"""Racers with the same car, for organisers and stewards."""

from collections import defaultdict
from dataclasses import dataclass, field
from datetime import datetime

from django.db.models import QuerySet

from accounts.models import Racer

from ...models import Entry, Race, RefusedCar, Submission, car_of


@dataclass(frozen=True)
class Sharer:
    """A racer with a shared car. ``how``: first, counts, excluded or refused; ``same_file``: byte-identical to the
    first."""

    racer: Racer
    how: str
    at: datetime
    same_file: bool


@dataclass
class SharedCar:
    """A car that several racers have sent to a race, or tried to; the first of them first."""

    car: str
    sharers: list[Sharer] = field(default_factory=list)


def shared_cars(race: Race) -> list[SharedCar]:
    """Cars that several racers sent or tried to send to a race, in order of arrival; withdrawn racers included."""
    sent = Submission.objects.filter(entry__race=race, entry__is_baseline=False, is_void=False)
    by_car: dict[str, dict[int, tuple[datetime, str, bool]]] = defaultdict(dict)
    columns = ("network", "network__facts", "entry__racer", "submitted_at", "car_of")
    for sha256, facts, racer, at, other in sent.order_by("submitted_at", "pk").values_list(*columns).iterator():
        by_car[car_of(sha256, facts)].setdefault(racer, (at, sha256, other is not None))
    refused: dict[str, list[RefusedCar]] = defaultdict(list)
    for one in RefusedCar.objects.filter(car__race=race).select_related("car", "racer").order_by("at", "pk"):
        refused[one.car.car].append(one)
    found = {car: racers for car, racers in by_car.items() if len(racers) > 1 or car in refused}
    wanted = {racer for racers in found.values() for racer in racers}
    racers = {entry.racer_id: entry.racer for entry in _entries(race, wanted)}
    return [_shared(car, sent_by, refused[car], racers) for car, sent_by in found.items()]


def _entries(race: Race, racers: set[int]) -> QuerySet[Entry]:
    return Entry.objects.filter(race=race, racer__in=racers).select_related("racer")


def _shared(
    car: str, sent_by: dict[int, tuple[datetime, str, bool]], refused: list[RefusedCar], racers: dict[int, Racer]
) -> SharedCar:
    shared = SharedCar(car)
    first = next(iter(sent_by.values()))[1]
    for number, (racer, (at, sha256, excluded)) in enumerate(sent_by.items()):
        how = "excluded" if excluded else "counts" if number else "first"
        shared.sharers.append(Sharer(racers[racer], how, at, sha256 == first))
    shared.sharers += [Sharer(one.racer, "refused", one.at, one.same_file) for one in refused]
    return shared
