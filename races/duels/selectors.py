"""A race's duels for pages and the API: heats, cross table or bracket, and the reader's next heat."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from django.db.models import Prefetch
from django.utils.translation import gettext as _

from accounts.models import Viewer

from ..boards.selectors.board import ORDER
from ..models import Draw, Duel, DuelCompetitor, DuelFormat, DuelState, Entry, Race
from .bracket import LEGS, Tie, bracket, tie_of, winners_of
from .points import HeatDrive, points_lap_time


@dataclass(frozen=True)
class Heat:
    """One heat. ``cars``: the front one first; ``at_the_end``: in the order at the end once decided."""

    duel: Duel
    cars: list[DuelCompetitor]
    is_mine: bool

    @property
    def at_the_end(self) -> list[DuelCompetitor]:
        return sorted(self.cars, key=lambda car: car.place or car.grid)


@dataclass(frozen=True)
class Meeting:
    """One car against another in a heat. ``ahead``: None until it is decided, and for a void heat."""

    duel: Duel
    in_front: bool
    ahead: bool | None


@dataclass(frozen=True)
class CrossRow:
    """A car's row of the cross table. ``place``: from 1; ``cells``: its meetings with each car, None with itself."""

    place: int
    entry: Entry
    cells: list[list[Meeting] | None]
    is_me: bool


@dataclass(frozen=True)
class TreeCar:
    """A place of a tie. ``entry``: None while unknown; ``points``: in the heats of this tie."""

    entry: Entry | None
    points: int | None
    won: bool
    is_me: bool


@dataclass(frozen=True)
class TreeTie:
    """A tie with its two places (one for a bye) and its heats."""

    tie: Tie
    cars: list[TreeCar]
    heats: list[Heat]


@dataclass(frozen=True)
class DuelRound:
    """A round: its name in the reader's language and its heats; for a bracket its ties."""

    number: int
    name: str
    heats: list[Heat]
    ties: list[TreeTie] = field(default_factory=list)

    @property
    def is_on(self) -> bool:
        """Whether a heat of it is in the queue or on track."""
        return any(heat.duel.state == DuelState.DRIVING for heat in self.heats)


@dataclass(frozen=True)
class Duels:
    """All duels of a drawn race. ``table``: of a round robin. ``gone``: racers that left since: not in the table,
    though the heats against them count. ``next``: the reader's next heat. ``decided`` of ``total`` heats, those of a
    bracket's rounds to come included, are over."""

    draw: Draw
    rounds: list[DuelRound]
    table: list[CrossRow]
    gone: list[Entry]
    next: Heat | None
    decided: int
    total: int

    @property
    def is_over(self) -> bool:
        return self.draw.over_at is not None

    @property
    def heats(self) -> list[Heat]:
        return [heat for each in self.rounds for heat in each.heats]


def duels_of(race: Race, racer: Viewer = None) -> Duels | None:
    """The duels of a race as ``racer`` sees them; None until they are drawn. Four queries."""
    draw = Draw.objects.filter(race=race).first()
    if draw is None:
        return None
    reader = racer.pk if racer is not None and racer.is_authenticated else None
    entries = list(Entry.objects.filter(race=race, seed__isnull=False).select_related("racer").order_by(*ORDER))
    heats = heats_of(race, reader, entries)
    total = len(heats)
    if race.duel_format == DuelFormat.BRACKET:
        rounds, table = _tree(draw, race.duel_heats, heats, entries, reader), []
        # of the best of three as many as will be driven for certain, and each third one that is
        sure = min(LEGS, race.duel_heats) * max(0, draw.entrants - 1)
        total = sure + sum(heat.duel.number % race.duel_heats == 0 for heat in heats) * (race.duel_heats > LEGS)
    else:
        rounds, table = _rounds(heats), _table(heats, entries, reader)
    return Duels(
        draw=draw,
        rounds=rounds,
        table=table,
        gone=[entry for entry in entries if entry.is_withdrawn],
        next=next((heat for heat in heats if heat.is_mine and not heat.duel.is_final), None),
        decided=sum(heat.duel.is_final for heat in heats),
        total=total,
    )


def heats_of(race: Race, reader: int | None = None, entries: Sequence[Entry] | None = None) -> list[Heat]:
    """The heats of a race that are known, in order. ``entries``: all that have a seed, when the caller has them."""
    if entries is None:
        entries = list(Entry.objects.filter(race=race, seed__isnull=False).select_related("racer"))
    by_id = {entry.pk: entry for entry in entries}
    cars = Prefetch("cars", DuelCompetitor.objects.order_by("grid"))
    heats = []
    for duel in Duel.objects.filter(race=race).select_related("evaluation").prefetch_related(cars):
        in_it = list(duel.cars.all())
        for car in in_it:
            car.entry = by_id[car.entry_id]
        heats.append(Heat(duel, in_it, any(car.entry.racer_id == reader for car in in_it)))
    return heats


def _rounds(heats: Sequence[Heat]) -> list[DuelRound]:
    rounds: dict[int, list[Heat]] = {}
    for heat in heats:
        rounds.setdefault(heat.duel.round, []).append(heat)
    return [DuelRound(number, _("Round %(number)s") % {"number": number}, each) for number, each in rounds.items()]


def _table(heats: Sequence[Heat], entries: Sequence[Entry], reader: int | None) -> list[CrossRow]:
    met: dict[tuple[int, int], list[Meeting]] = {}
    for heat in heats:
        for car in heat.cars:
            for other in heat.cars:
                if car is not other:
                    ahead = None if car.place is None or other.place is None else car.place < other.place
                    meeting = Meeting(heat.duel, car.grid < other.grid, ahead)
                    met.setdefault((car.entry_id, other.entry_id), []).append(meeting)
    on_board = [entry for entry in entries if not entry.is_withdrawn]
    return [
        CrossRow(
            place=place,
            entry=entry,
            cells=[None if entry is other else met.get((entry.pk, other.pk), []) for other in on_board],
            is_me=entry.racer_id == reader,
        )
        for place, entry in enumerate(on_board, start=1)
    ]


def _tree(
    draw: Draw, legs_most: int, heats: Sequence[Heat], entries: Sequence[Entry], reader: int | None
) -> list[DuelRound]:
    by_seed = {entry.seed: entry for entry in entries}
    of_tie: dict[tuple[int, int], list[Heat]] = {}
    for heat in heats:
        of_tie.setdefault((heat.duel.round, tie_of(heat.duel.number, legs_most)), []).append(heat)
    decided = {(heat.duel.round, heat.duel.number): _drives(heat) for heat in heats if heat.duel.is_final}
    rounds = []
    for ties in bracket(draw.entrants, winners_of(decided, legs_most)):
        shown = []
        for tie in ties:
            legs = of_tie.get((tie.round, tie.number), [])
            unknown = 0 if tie.bye else 2 - len(tie.cars)
            cars = [
                TreeCar(
                    entry=by_seed[seed],
                    points=points_lap_time(_drives(heat)[seed] for heat in legs).points if legs else None,
                    won=seed == tie.winner,
                    is_me=by_seed[seed].racer_id == reader,
                )
                for seed in tie.cars
            ]
            shown.append(TreeTie(tie, cars + [TreeCar(None, None, False, False)] * unknown, legs))
        number = ties[0].round
        in_round = [heat for heat in heats if heat.duel.round == number]
        rounds.append(DuelRound(number, round_name(len(ties)), in_round, shown))
    return rounds


def drive_of(car: DuelCompetitor) -> HeatDrive:
    """A car of a heat as the pure functions know it: without a place and points until that is decided, or void."""
    return HeatDrive(car.place or 0, car.points or 0, car.laps, car.time_ms)


def _drives(heat: Heat) -> dict[int, HeatDrive]:
    """The drive of each seed in a heat: empty until it is decided."""
    return {car.entry.seed: drive_of(car) for car in heat.cars if car.entry.seed is not None}


def round_name(ties: int) -> str:
    """The name of a round with this number of ties, in the reader's language."""
    if ties == 1:
        return _("Final")
    if ties == 2:
        return _("Semi-finals")
    if ties == 4:
        return _("Quarter-finals")
    return _("Round of %(cars)s") % {"cars": 2 * ties}
