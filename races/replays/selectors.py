"""The runs that can be replayed together, and those that are offered."""

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.db.models import Exists, F, OuterRef, Q, QuerySet

from accounts.models import Follow, Racer
from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation, State
from paddock.errors import UserFault
from paddock.geometry.track import CCW
from paddock.rules.race import OF_A_LAP_TIME

from ..boards.selectors.results import place_of
from ..entries.selectors.visibility import evaluations_visible_to
from ..models import Duel, Entry, Race, Submission

OFFERED = 10  # of each kind but the leader
KINDS = 8  # of offers whose SQL a process keeps
_SHOWN = ("owner", "model", "result", "submission__entry__race", "duel__race")
_BOARD = ("rank_score", "rank_lap", "resets", "achieved_at")


class Why(StrEnum):
    LEADER = "leader"
    AHEAD = "ahead"
    MINE = "mine"
    FOLLOWED = "followed"
    HOUSE = "house"
    FAST = "fast"


@dataclass(frozen=True)
class RunOffer:
    """A run to compare with. ``gap_ms``: of its best lap, None for other rules; ``race``: None for a test drive."""

    why: Why
    evaluation: Evaluation
    gap_ms: int | None
    race: Race | None = None


@dataclass(frozen=True)
class _Kind:
    """What decides, besides its track, which runs compare with a run, and by the rules whose laps do."""

    engine: str
    direction: str
    rules: tuple[tuple[str, Any], ...]

    @classmethod
    def of(cls, run: Evaluation) -> "_Kind":
        rules = run.spec["rules"]
        alike = tuple((name, rules[name]) for name in OF_A_LAP_TIME if rules.get(name) is not None)
        return cls(run.result.engine, direction_of(run), alike)


def race_of(evaluation: Evaluation) -> Race | None:
    """The race that a run was driven in; None for a test drive."""
    submission = getattr(evaluation, "submission", None)
    if submission is not None:
        return submission.entry.race
    duel = getattr(evaluation, "duel", None)
    return duel.race if duel is not None else None


def direction_of(evaluation: Evaluation) -> str:
    return evaluation.spec["rules"].get("direction", CCW)


def same_rules(evaluation: Evaluation, other: Evaluation) -> bool:
    """Whether the laps of two runs were driven by the same rules, so that their times compare."""
    rules = evaluation.spec["rules"], other.spec["rules"]
    return all(rules[0].get(name) == rules[1].get(name) for name in OF_A_LAP_TIME)


def comparable_with(evaluation: Evaluation, reader: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """Visible finished runs of the same engine, on the same track and in the same direction. Twin of
    :func:`refuse_incomparable`."""
    return _comparable(_Kind.of(evaluation), reader, evaluation.pk, evaluation.track_id)


def _comparable(kind: "_Kind", reader: Racer | AnonymousUser | None, run: Any, track: Any) -> QuerySet[Evaluation]:
    runs = evaluations_visible_to(reader).filter(track_id=track, state=State.FINISHED)
    runs = runs.filter(driven_in(kind.direction), result__engine=kind.engine)
    return runs.exclude(pk=run).select_related("result")


def driven_in(direction: str) -> Q:
    """Runs in a direction; those without one in their rules are counter-clockwise."""
    driven = Q(spec__rules__direction=direction)
    return driven | Q(spec__rules__direction=None) if direction == CCW else driven


def without_races(runs: QuerySet[Evaluation], hidden: Collection[int]) -> QuerySet[Evaluation]:
    """The runs but for those of the races with these ids."""
    if not hidden:
        return runs
    runs = runs.exclude(pk__in=Submission.objects.filter(entry__race__in=hidden).values("evaluation"))
    return runs.exclude(pk__in=Duel.objects.filter(race__in=hidden).values("evaluation"))


def refuse_incomparable(evaluation: Evaluation, other: Evaluation) -> None:
    """Raises UserFault ``compare_itself``, ``compare_no_result``, ``compare_elsewhere`` or ``compare_engine``."""
    if evaluation.pk == other.pk:
        raise UserFault("compare_itself")
    if not (evaluation.state == other.state == State.FINISHED):
        raise UserFault("compare_no_result")
    if (evaluation.track_id, direction_of(evaluation)) != (other.track_id, direction_of(other)):
        raise UserFault("compare_elsewhere")
    if evaluation.result.engine != other.result.engine:
        raise UserFault("compare_engine", engine=evaluation.result.engine, other=other.result.engine)


def offers_to_compare(
    evaluation: Evaluation,
    reader: Racer | AnonymousUser | None,
    race: Race | None,
    hidden: Collection[int] = (),
) -> list[RunOffer]:
    """The offered runs, each once: the leader's of ``race``, that of the car ahead, the reader's, those of racers that
    they follow, house cars' and the fastest by the same rules. ``hidden``: races whose results are spoilers."""
    reader_pk = reader.pk if reader is not None and reader.is_authenticated else None
    ahead = run_ahead(evaluation) if race is not None else ""
    is_staff = reader is not None and reader.is_staff
    query = _offered(_Kind.of(evaluation), reader_pk is not None, is_staff, race is not None, frozenset(hidden))
    race_pk = None if race is None else race.pk
    offered = query(run=evaluation.pk, track=evaluation.track_id, ahead=ahead, racer=reader_pk, race=race_pk)
    mine_at = _place(evaluation) if _counts_in(evaluation, race) else None
    leader = min((run for run in offered if _counts_in(run, race)), key=_place, default=None)
    if leader is not None and mine_at is not None and mine_at < _place(leader):
        leader = None  # the run itself leads
    mine = evaluation.result.best_lap_ms

    def offer(run: Evaluation) -> RunOffer:
        theirs = run.result.best_lap_ms
        gap = None if mine is None or theirs is None or not same_rules(evaluation, run) else theirs - mine
        if run == leader:
            why = Why.LEADER
        elif run.public_id == ahead and mine_at is not None and _place(run) < mine_at:
            why = Why.AHEAD
        elif run.owner_id == reader_pk:
            why = Why.MINE
        elif run.is_followed:  # type: ignore[attr-defined]  # annotated
            why = Why.FOLLOWED
        else:
            why = Why.HOUSE if run.owner.is_house else Why.FAST
        return RunOffer(why, run, gap, race_of(run))

    order = [*Why]
    never = float("inf")

    def rank(found: RunOffer) -> tuple[int, float, int]:
        best = found.evaluation.result.best_lap_ms
        return order.index(found.why), never if best is None else best, found.evaluation.pk

    return sorted(map(offer, offered), key=rank)


@lru_cache(maxsize=KINDS)
def _offered(
    kind: _Kind, is_racer: bool, is_staff: bool, in_race: bool, hidden: frozenset[int]
) -> KeptQuery[Evaluation]:
    """The runs to offer for a run of this kind, to a guest, a racer or an admin."""

    def rows(run: Any, track: Any, ahead: Any, racer: Any = None, race: Any = None) -> QuerySet[Evaluation]:
        runs = _comparable(kind, Racer(pk=racer, is_staff=is_staff) if is_racer else None, run, track)
        runs = without_races(runs, hidden)
        ranked = runs.filter(result__best_lap_ms__isnull=False).order_by("result__best_lap_ms", "pk")
        alike = ranked.filter(**{f"spec__rules__{name}": value for name, value in kind.rules})
        wanted = [alike.filter(owner__is_house=True)[:OFFERED], alike[:OFFERED]]
        follows = Follow.objects.filter(follower=racer if is_racer else None, followed=OuterRef("owner"))
        if in_race:
            counted = runs.filter(submission__entry__race=race, submission__entry__best=F("submission__pk"))
            counted = counted.filter(submission__entry__is_baseline=False)
            wanted.append(counted.order_by(*(f"submission__entry__{name}" for name in _BOARD))[:1])
        if is_racer:
            wanted += [ranked.filter(owner=racer)[:OFFERED], alike.filter(Exists(follows))[:OFFERED]]
        wanted.append(runs.filter(public_id=ahead))
        # each part has a limit of its own, which SQLite takes in subqueries only
        parts = [Evaluation.objects.filter(pk__in=part.values("pk")).order_by().values("pk") for part in wanted]
        chosen = Evaluation.objects.filter(pk__in=parts[0].union(*parts[1:])).order_by().select_related(*_SHOWN)
        return chosen.defer("result__trajectory").annotate(is_followed=Exists(follows))

    return KeptQuery(rows)


def _counts_in(run: Evaluation, race: Race | None) -> bool:
    """Whether a run is the counted one of a racer in a race."""
    submission = getattr(run, "submission", None)
    if race is None or submission is None:
        return False
    entry: Entry = submission.entry
    return entry.race_id == race.pk and entry.best_id == submission.pk and not entry.is_baseline


def _place(run: Evaluation) -> list[Any]:
    """The place of a counted run on its board."""
    return [getattr(run.submission.entry, name) for name in _BOARD]


def run_ahead(evaluation: Evaluation) -> str:
    """The id of the counted run of the car ahead, else of the leader, else of a house car; empty without any."""
    submission = getattr(evaluation, "submission", None)
    if submission is None:
        return ""
    place = place_of(submission.entry)
    rival = place.ahead or place.leader
    best = rival.entry.best if rival else _house_car_ahead(submission.entry)
    return best.evaluation.public_id if best else ""


def _house_car_ahead(entry: Entry) -> Submission | None:
    house = Entry.objects.filter(race=entry.race_id, is_baseline=True, best__isnull=False).exclude(pk=entry.pk)
    cars = list(house.select_related("best__evaluation").order_by("rank_score", "rank_lap", "pk"))
    faster = [car for car in cars if car.rank_score < entry.rank_score]
    return (faster[-1] if faster else cars[0]).best if cars else None


def named_runs(
    words: Collection[str], evaluation: Evaluation, reader: Racer | AnonymousUser | None, hidden: Collection[int] = ()
) -> dict[str, str]:
    """For each of the words (:class:`Why`) the id of the run that it names: the first of those offered."""
    named: dict[str, str] = {}
    if Why.AHEAD in words and (ahead := run_ahead(evaluation)):
        named[Why.AHEAD] = ahead
    if any(word != Why.AHEAD for word in words):
        for offer in offers_to_compare(evaluation, reader, race_of(evaluation), hidden):
            named.setdefault(offer.why, offer.evaluation.public_id)
    return named
