"""One car, one place: a car's first sender keeps its place, unless the race allows shared cars.

The racer who brought a car to the site has priority over later senders. House cars take no place; a car is free again
after its racer left the race. Places are rows (:class:`~races.models.RaceCar`) written under the race's lock.
"""

from collections import defaultdict
from collections.abc import Collection
from datetime import datetime

from django.db import transaction
from django.db.models import Q, QuerySet

from accounts.models import Racer
from core.database.after_commit import after_commit
from evaluation.models import Network, TrainedModel
from paddock.errors import UserFault

from ...events import record_board
from ...models import Entry, Race, RaceCar, RefusedCar, Submission, car_of
from .locks import lock_entries
from .standings import work_out_standings

BATCH = 500


def take_place(*, entry: Entry, race: Race, network: Network) -> None:
    """Take a car's place for an entry, locked with its race. Raises UserFault("car_of_another") if another entry holds
    it, unless this entry's racer brought the car: then the other's result goes after the commit."""
    if race.shared_cars or entry.is_baseline:
        return
    car = car_of(network.pk, network.facts)
    place, _created = RaceCar.objects.get_or_create(race=race, car=car, defaults={"entry": entry})
    if place.entry_id == entry.pk:
        return
    if not _is_held(place):
        RaceCar.objects.filter(pk=place.pk).update(entry=entry)
        return
    sent = _counted(race).filter(_same(car)).values_list("network", flat=True)
    if _brought_by({*sent, network.pk}) != entry.racer_id:
        raise UserFault("car_of_another", racer=place.entry.racer.alias)
    RaceCar.objects.filter(pk=place.pk).update(entry=entry)
    after_commit(settle_cars, race=race)


def note_refused(*, race: Race, racer: Racer, network: Network, now: datetime) -> None:
    """Write down for the organiser that a racer tried to send a car that was in the race already."""
    place = RaceCar.objects.filter(race=race, car=car_of(network.pk, network.facts)).first()
    if place is not None:
        same_file = Submission.objects.filter(entry=place.entry_id, network=network, is_void=False).exists()
        attempt = {"at": now, "same_file": same_file}
        RefusedCar.objects.update_or_create(car=place, racer=racer, defaults=attempt)


@transaction.atomic
def settle_cars(*, race: Race) -> int:
    """Recompute the holder of each car and the standings of changed entries; returns the number changed."""
    entries = {entry.pk: entry for entry in lock_entries(race.entries.values_list("pk", flat=True))}
    race = Race.objects.get(pk=race.pk)
    holders = _holders(race)
    changed = []
    for submission in _counted(race).select_related("network").order_by("submitted_at", "pk").iterator(BATCH):
        car = car_of(submission.network_id, submission.network.facts)
        holder = holders[car]
        wanted = None if race.shared_cars or holder == submission.entry_id else holder
        if submission.car_of_id != wanted:
            submission.car_of_id = wanted
            changed.append(submission)
    _write_places(race, {} if race.shared_cars else holders)
    Submission.objects.bulk_update(changed, ["car_of"], batch_size=BATCH)
    touched = [entries[pk] for pk in sorted({submission.entry_id for submission in changed})]
    work_out_standings(race, [entry for entry in touched if entry.seed is None])
    if changed:
        record_board(race)
    return len(changed)


def settle_after_commit(entry: Entry) -> None:
    """Settle the cars of an entry's race if its leaving or coming back changes whose they are."""
    if entry.race.shared_cars or entry.is_baseline:
        return
    sent = entry.submissions.filter(is_void=False).values_list("network", "network__facts")
    cars = {car_of(sha256, facts) for sha256, facts in sent}
    others = RaceCar.objects.filter(race=entry.race_id, car__in=cars).exclude(entry=entry)
    excluded = Submission.objects.filter(Q(car_of=entry) | Q(entry=entry, car_of__isnull=False))
    if others.exists() or excluded.exists():
        after_commit(settle_cars, race=entry.race)


def _counted(race: Race) -> QuerySet[Submission]:
    """Submissions of entered racers that may count."""
    return Submission.objects.filter(
        entry__race=race, entry__is_baseline=False, entry__withdrawn_at=None, is_void=False
    )


def _holders(race: Race) -> dict[str, int]:
    """The entry whose each car of a race is: of the racer who brought the car to the site, else who sent it first."""
    entries: dict[str, dict[int | None, int]] = defaultdict(dict)  # of each car, by racer
    networks: dict[str, set[str]] = defaultdict(set)
    columns = ("network", "network__facts", "entry", "entry__racer")
    for sha256, facts, entry, racer in _counted(race).order_by("submitted_at", "pk").values_list(*columns).iterator():
        car = car_of(sha256, facts)
        entries[car].setdefault(racer, entry)
        networks[car].add(sha256)
    first = {car: next(iter(sent_by.values())) for car, sent_by in entries.items()}
    several = [car for car, sent_by in entries.items() if len(sent_by) > 1]
    return first | {car: entries[car].get(_brought_by(networks[car]), first[car]) for car in several}


def _brought_by(networks: Collection[str]) -> int | None:
    """The racer in whose garage one of these networks was before it was in any other; the house's id for its own."""
    models = TrainedModel.objects.filter(network__in=networks).order_by("created_at", "pk")
    return models.values_list("owner", flat=True).first()


def _same(car: str) -> Q:
    """Submissions of a car."""
    return Q(network=car) | Q(network__facts__answers=car)


def _is_held(place: RaceCar) -> bool:
    """Whether the entry is still in the race with this car."""
    if place.entry.is_withdrawn:
        return False
    return Submission.objects.filter(_same(place.car), entry=place.entry, is_void=False).exists()


def _write_places(race: Race, holders: dict[str, int]) -> None:
    known = dict(RaceCar.objects.filter(race=race).values_list("car", "entry"))
    gone = [car for car in known if car not in holders]
    RaceCar.objects.filter(race=race, car__in=gone).delete()
    for car, entry in holders.items():
        if car in known and known[car] != entry:
            RaceCar.objects.filter(race=race, car=car).update(entry=entry)
    RaceCar.objects.bulk_create(
        [RaceCar(race=race, car=car, entry_id=entry) for car, entry in holders.items() if car not in known],
        batch_size=BATCH,
    )
