"""Cups of the day for pages and the API."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from django.contrib.auth.models import AnonymousUser
from django.db.models import Count, Q, QuerySet

from accounts.models import Racer
from races.models import Duel, DuelCompetitor, DuelState, Entry, Race, RaceState

from ..models import Cup, CupPlace, CupStarter

TROPHIES_SHOWN = 10


@dataclass(frozen=True)
class Recap:
    """Highlights of a finished cup: the entry with the fastest qualifying lap, the racer who ``rose`` the most places
    within their division, and the two cars of the heat with the smallest gap."""

    fastest: Entry | None
    riser: CupPlace | None
    rose: int
    closest: tuple[DuelCompetitor, DuelCompetitor] | None
    gap_ms: int


def cups_listed() -> QuerySet[Cup]:
    """All cups, the latest first, with their races and how many had a place."""
    related = ("race__track",)
    return Cup.objects.select_related(*related).annotate(racers=Count("places")).order_by("-day")


def cup_now(now: datetime) -> Cup | None:
    return cups_listed().filter(over_at=None, race__cancelled_at=None).order_by("day").first()


def cups_over() -> QuerySet[Cup]:
    """Cups that have their winners, the latest first, the winners of first divisions with them."""
    return cups_listed().filter(over_at__isnull=False, race__cancelled_at=None)


def winners_of_cups(cups: Sequence[Cup]) -> dict[int, Racer]:
    won = CupPlace.objects.filter(cup__in=cups, division=1, place=1).select_related("racer")
    return {place.cup_id: place.racer for place in won}


def division_places(cup: Cup) -> list[tuple[int, Race | None, list[CupPlace]]]:
    """Of each division its number, its knock-out and its places; the places are empty before the cup is over."""
    places: dict[int, list[CupPlace]] = {}
    for place in cup.places.select_related("racer").order_by("division", "place"):
        places.setdefault(place.division, []).append(place)
    races = {one.number: one.race for one in cup.divisions.select_related("race__track").order_by("number")}
    return [(number, races.get(number), places.get(number, [])) for number in sorted(races.keys() | places.keys())]


def recap_of(cup: Cup) -> Recap:
    """What to tell of a cup, from its rows alone."""
    ranked = Entry.objects.filter(race=cup.race, withdrawn_at=None, is_baseline=False, classified=True)
    fastest = (
        ranked.filter(best_lap_ms__isnull=False).select_related("racer", "race").order_by("best_lap_ms", "pk").first()
    )
    riser, rose = None, 0
    for _, _, places in division_places(cup):
        seeds = {one.pk: seed for seed, one in enumerate(sorted(places, key=lambda one: one.qualified), start=1)}
        for one in places:
            if seeds[one.pk] - one.place > rose:
                riser, rose = one, seeds[one.pk] - one.place
    closest, gap_ms = _closest(cup)
    return Recap(fastest, riser, rose, closest, gap_ms)


def _closest(cup: Cup) -> tuple[tuple[DuelCompetitor, DuelCompetitor] | None, int]:
    """The two cars of the closest heat in which both drove all laps, and the gap in milliseconds."""
    heats = Duel.objects.filter(race__cup_division__cup=cup, state=DuelState.DECIDED, evaluation__isnull=False)
    found: tuple[DuelCompetitor, DuelCompetitor] | None = None
    least = 0
    cars: dict[int, list[DuelCompetitor]] = {}
    for car in DuelCompetitor.objects.filter(duel__in=heats, laps=cup.race.laps).select_related("entry__racer", "duel"):
        cars.setdefault(car.duel_id, []).append(car)
    for heat in sorted(cars):
        if len(cars[heat]) == 2:
            first, second = sorted(cars[heat], key=lambda car: (car.time_ms, car.pk))
            gap = second.time_ms - first.time_ms
            if found is None or gap < least:
                found, least = (first, second), gap
    return found, least


def trophies_of(racer: Racer) -> list[CupPlace]:
    """The divisions that a racer won, the latest first."""
    won = CupPlace.objects.filter(racer=racer, place=1).select_related("cup").order_by("-cup__day")
    return list(won[:TROPHIES_SHOWN])


def most_trophies(limit: int = TROPHIES_SHOWN) -> list[Racer]:
    """The racers with the most wins of first divisions, with ``cups_won`` and ``divisions_won``."""
    first, any_ = Q(cup_places__place=1, cup_places__division=1), Q(cup_places__place=1)
    racers = Racer.objects.annotate(
        cups_won=Count("cup_places", filter=first), divisions_won=Count("cup_places", filter=any_)
    )
    return list(
        racers.filter(divisions_won__gt=0, is_active=True).order_by("-cups_won", "-divisions_won", "pk")[:limit]
    )


def starter_of(racer: Racer | AnonymousUser) -> CupStarter | None:
    if not racer.is_authenticated:
        return None
    return CupStarter.objects.filter(racer=racer).select_related("model").first()


def stage_of(cup: Cup, now: datetime) -> str:
    """What a cup is in the middle of: ``upcoming``, ``qualifying``, ``knock_out``, ``over`` or ``cancelled``."""
    if cup.race.cancelled_at is not None:
        return "cancelled"
    if cup.over_at is not None:
        return "over"
    state = cup.race.state_at(now)
    return {RaceState.UPCOMING: "upcoming", RaceState.OPEN: "qualifying"}.get(state, "knock_out")
