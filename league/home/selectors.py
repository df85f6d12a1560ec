"""The first page: the lap that it plays, the races as cards and folded, recent results, and what the reader can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.db.models import Exists, OuterRef, QuerySet

from accounts.groups.selectors import remember_groups
from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from core.forms import explain
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.selectors import garage_of
from paddock.errors import UserFault
from paddock.simulator.results import LapDocument
from races.boards.selectors.board import CLASSIFIED, BoardRow, to_gain_ms, with_ahead_score
from races.boards.selectors.counts import with_place
from races.entries.eligibility import read_for_checks, refusal
from races.models import Division, Entry, Race, RaceKind, Submission
from races.replays.run_maps import ColourBy, trajectories
from races.runs.shown_runs import latest_shown
from tracks.drawing.maps import Trajectory

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


LOOKED_AT, CARDS, LEAST_CARDS = 24, 4, 2
RESULTS = 6
OWN = 5
PLACES_READ = 50


def home_races(
    races: Sequence[Race], reader: Racer | AnonymousUser, now: datetime
) -> tuple[list[Race], list[tuple[Race, str]]]:
    """The open ``races`` of the first page: cards of races that the reader may enter, the league's first, and the other
    races, each with the reason why the reader may not enter it ("" if they may).

    A race that nobody has entered has a card only if it is the league's or the page would be nearly empty.
    """
    refused = _refusals(races, reader, now)
    allowed = [race for race in races if race.pk not in refused]
    busy = [race for race in allowed if race.entry_count or race.kind == RaceKind.LEAGUE]
    quiet = [race for race in allowed if race not in busy]
    cards = (busy + quiet[: max(0, LEAST_CARDS - len(busy))])[:CARDS]
    rest = sorted((race for race in races if race not in cards), key=lambda race: race.pk in refused)
    return cards, [(race, refused.get(race.pk, "")) for race in rest]


def _refusals(races: Sequence[Race], reader: Racer | AnonymousUser, now: datetime) -> dict[int, str]:
    """Why the reader may not enter, by race. A guest counts as a racer without any result."""
    if not isinstance(reader, Racer):
        pro = [race for race in races if race.kind == RaceKind.LEAGUE and race.division == Division.PRO]
        closed: dict[int, UserFault] = {race.pk: UserFault("race_pro_only") for race in pro}
        closed |= {race.pk: UserFault("race_group_only", group=race.group.name) for race in races if race.group}
    else:
        checked, reader = [copy(race) for race in races], copy(reader)  # checks keep what they have read
        read_for_checks(checked, reader)
        remember_groups(reader, sorted({race.group_id for race in races if race.group_id}))
        faults = ((race.pk, refusal(race, reader, now)) for race in checked)
        closed = {pk: fault for pk, fault in faults if fault is not None}
    return {pk: explain(fault) for pk, fault in closed.items()}


@dataclass(frozen=True)
class LeadingLap:
    """The best lap of a race's leader, or of its fastest house car while no racer is classified."""

    race: Race
    entry: Entry
    run: Evaluation
    lap: LapDocument
    lines: list[Trajectory]


def leading_lap(
    races: Sequence[Race], podiums: Mapping[int, Sequence[BoardRow]], house_cars: Mapping[int, Sequence[Entry]]
) -> LeadingLap | None:
    """The lap to play, of the first of these races with one; led by racers before led by house cars. One query."""
    leaders = [podiums[race.pk][0].entry for race in races if podiums.get(race.pk)]
    leaders += [house_cars[race.pk][0] for race in races if house_cars.get(race.pk)]
    runs = {entry.pk: entry.best.evaluation for entry in leaders if entry.best is not None}
    results = Result.objects.filter(evaluation__in=[run.pk for run in runs.values()])  # sealed ones are not among them
    driven = {result.evaluation_id: result for result in results.only("evaluation", "laps", "trajectory")}
    by_id = {race.pk: race for race in races}
    for entry in leaders:
        race, run = by_id[entry.race_id], runs.get(entry.pk)
        result = None if run is None else driven.get(run.pk)
        if run is None or result is None or not race.track.has_shape:
            continue
        laps = [lap for lap in result.laps if lap["complete"] and lap["number"] <= len(result.trajectory)]
        if laps:
            best = min(laps, key=lambda lap: lap["time_ms"])
            lines = trajectories(result.trajectory, ColourBy.SPEED, best["number"])
            return LeadingLap(race, entry, run, best, lines)
    return None


def recent_results(races: Sequence[Race], most: int = RESULTS) -> list[Entry]:
    """The racers of these races who came on its board or improved last, the latest first."""
    entries = Entry.objects.filter(CLASSIFIED, race__in=[race.pk for race in races], withdrawn_at=None)
    entries = entries.filter(is_baseline=False, best__isnull=False).select_related("racer", "best__evaluation")
    found, by_id = list(entries.order_by("-best_id")[:most]), {race.pk: race for race in races}
    for entry in found:
        entry.race = by_id[entry.race_id]
    return found


@dataclass(frozen=True)
class MyPlace:
    """Where the reader stands in a race. ``gain_ms``: to the racer ahead, None for none."""

    race: Race
    rank: int
    gain_ms: int | None


_places: KeptQuery[Any] = KeptQuery(
    lambda racer: with_place(
        with_ahead_score(Entry.objects.filter(CLASSIFIED, racer_id=racer, withdrawn_at=None, is_baseline=False))
        .only("race", "classified", "rank_score", "is_live", "seed")
        .order_by("-best_id")[:PLACES_READ]
    )
)


def my_places(racer: Racer, races: Sequence[Race]) -> list[MyPlace]:
    """The racer's places in those of ``races`` where they have one: one query."""
    found = {entry.race_id: entry for entry in _places(racer=racer.pk)}
    mine = [(race, found[race.pk]) for race in races if race.pk in found]
    return [MyPlace(race, entry.place + 1, to_gain_ms(entry)) for race, entry in mine]


_latest = KeptQuery(lambda racer: latest_shown(Evaluation.objects.filter(owner=racer), OWN))
_models: KeptQuery[TrainedModel] = KeptQuery(
    lambda racer: garage_of(racer).select_related(None).only("public_id", "name", "metadata")[:OWN]
)


def latest_runs(racer: Racer) -> list[Evaluation]:
    """The racer's latest runs that count, the latest first, with what the table of runs shows of them."""
    return _latest(racer=racer.pk)


def newest_models(racer: Racer) -> list[TrainedModel]:
    """The racer's newest models, with their names and metadata."""
    return _models(racer=racer.pk)


NEWCOMER_FOR = timedelta(days=60)


@dataclass(frozen=True)
class FirstSteps:
    """What a racer has done so far: got a car, submitted it, got a place on a board, raced in the league."""

    has_car: bool
    has_sent: bool
    has_place: bool
    in_league: bool

    @property
    def done(self) -> int:
        return sum((self.has_car, self.has_sent, self.has_place, self.in_league))


def first_steps(racer: Racer, now: datetime) -> FirstSteps | None:
    """A newcomer's progress; None after all four steps or 60 days, and in a class: one query or none."""
    if racer.is_house or now - racer.joined_at > NEWCOMER_FOR:
        return None
    steps = next((FirstSteps(*done) for done in _steps(racer=racer.pk)), None)
    return None if steps is None or steps.done == 4 else steps


def _done(racer: Any) -> QuerySet[Racer, tuple[bool, bool, bool, bool]]:
    entries = Entry.objects.filter(racer=OuterRef("pk"))
    sent = Submission.objects.filter(entry__racer=OuterRef("pk"))
    return Racer.objects.filter(pk=racer, learner=None).values_list(
        Exists(TrainedModel.objects.filter(owner=OuterRef("pk"))),
        Exists(sent),
        Exists(entries.filter(CLASSIFIED)),
        Exists(sent.filter(entry__race__kind=RaceKind.LEAGUE)),
    )


_steps = KeptQuery(_done)
