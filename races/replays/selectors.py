"""The runs that can be replayed together, and those that are offered."""

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum

from django.contrib.auth.models import AnonymousUser
from django.db.models import F, Q, QuerySet

from accounts.models import Follow, Racer
from evaluation.models import Evaluation, State
from paddock.errors import UserFault
from paddock.rules.race import OF_A_LAP_TIME

from ..boards.selectors.results import place_of
from ..entries.selectors.visibility import evaluations_visible_to
from ..models import Duel, Entry, Race, Submission

OFFERED = 10  # of each kind but the leader
_CCW = "ccw"


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


def race_of(evaluation: Evaluation) -> Race | None:
    """The race that a run was driven in; None for a test drive."""
    submission = getattr(evaluation, "submission", None)
    if submission is not None:
        return submission.entry.race
    duel = getattr(evaluation, "duel", None)
    return duel.race if duel is not None else None


def direction_of(evaluation: Evaluation) -> str:
    return evaluation.spec["rules"].get("direction", _CCW)


def same_rules(evaluation: Evaluation, other: Evaluation) -> bool:
    """Whether the laps of two runs were driven by the same rules, so that their times compare."""
    rules = evaluation.spec["rules"], other.spec["rules"]
    return all(rules[0].get(name) == rules[1].get(name) for name in OF_A_LAP_TIME)


def comparable_with(evaluation: Evaluation, reader: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """Visible finished runs of the same engine, on the same track and in the same direction. Twin of
    :func:`refuse_incomparable`."""
    runs = evaluations_visible_to(reader).filter(track_id=evaluation.track_id, state=State.FINISHED)
    direction = direction_of(evaluation)
    driven = Q(spec__rules__direction=direction)
    if direction == _CCW:
        driven |= Q(spec__rules__direction=None)
    return (
        runs.filter(driven, result__engine=evaluation.result.engine).exclude(pk=evaluation.pk).select_related("result")
    )


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
    runs = (
        comparable_with(evaluation, reader)
        .select_related("result", "submission__entry__race", "duel__race")
        .defer("result__trajectory", "track__npy")
    )
    if hidden:
        in_race = Submission.objects.filter(entry__race__in=hidden).values("evaluation")
        runs = runs.exclude(pk__in=in_race)
        runs = runs.exclude(pk__in=Duel.objects.filter(race__in=hidden).values("evaluation"))
    ranked = runs.filter(result__best_lap_ms__isnull=False).order_by("result__best_lap_ms", "pk")
    alike = ranked.filter(
        **{
            f"spec__rules__{name}": value
            for name in OF_A_LAP_TIME
            if (value := evaluation.spec["rules"].get(name)) is not None
        }
    )
    kinds: list[tuple[Why, QuerySet[Evaluation]]] = []
    if race is not None:
        counted = runs.filter(submission__entry__race=race, submission__entry__best=F("submission__pk"))
        board = ("submission__entry__rank_score", "submission__entry__rank_lap", "submission__entry__resets")
        kinds.append((Why.LEADER, counted.order_by(*board, "submission__entry__achieved_at")[:1]))
        if ahead := run_ahead(evaluation):
            kinds.append((Why.AHEAD, runs.filter(public_id=ahead)))
    if reader is not None and reader.is_authenticated:
        kinds.append((Why.MINE, ranked.filter(owner=reader.pk)[:OFFERED]))
        followed = Follow.objects.filter(follower=reader.pk).values("followed")
        kinds.append((Why.FOLLOWED, alike.filter(owner__in=followed)[:OFFERED]))
    kinds.append((Why.HOUSE, alike.filter(owner__is_house=True)[:OFFERED]))
    kinds.append((Why.FAST, alike[:OFFERED]))
    found: dict[int, RunOffer] = {}
    mine = evaluation.result.best_lap_ms
    for why, some in kinds:
        for each in some:
            theirs = each.result.best_lap_ms
            gap = None if mine is None or theirs is None or not same_rules(evaluation, each) else theirs - mine
            found.setdefault(each.pk, RunOffer(why, each, gap, race_of(each)))
    return list(found.values())


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
    house = house.select_related("best__evaluation").order_by("rank_score", "rank_lap", "pk")
    found = house.filter(rank_score__lt=entry.rank_score).last() or house.first()
    return found.best if found else None


def named_run(
    word: str, evaluation: Evaluation, reader: Racer | AnonymousUser | None, hidden: Collection[int] = ()
) -> str:
    """The id of the run that ``word`` names (:class:`Why`): the first of those offered; empty without any."""
    if word == Why.AHEAD:
        return run_ahead(evaluation)
    offers = offers_to_compare(evaluation, reader, race_of(evaluation), hidden)
    return next((offer.evaluation.public_id for offer in offers if offer.why == word), "")
