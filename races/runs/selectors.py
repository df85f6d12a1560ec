"""With which runs a run can be compared, and which of them are offered."""

from dataclasses import dataclass
from enum import StrEnum

from django.contrib.auth.models import AnonymousUser
from django.db.models import F, Q, QuerySet

from accounts.models import Racer
from evaluation.models import Evaluation, State
from paddock.errors import UserFault
from paddock.rules.race import OF_A_LAP_TIME

from ..entries.selectors.visibility import evaluations_visible_to
from ..models import Race

OFFERED = 10  # of each kind but the leader
_CCW = "ccw"


class Why(StrEnum):
    LEADER = "leader"
    MINE = "mine"
    HOUSE = "house"
    FAST = "fast"


@dataclass(frozen=True)
class RunOffer:
    """A run to compare with. ``gap_ms``: of its best lap, None for other rules; ``race``: None for a test drive."""

    why: Why
    evaluation: Evaluation
    gap_ms: int | None
    race: Race | None = None


def direction_of(evaluation: Evaluation) -> str:
    return evaluation.spec["rules"].get("direction", _CCW)


def same_rules(evaluation: Evaluation, other: Evaluation) -> bool:
    """Whether the laps of two runs were driven by the same rules, so that their times compare."""
    rules = evaluation.spec["rules"], other.spec["rules"]
    return all(rules[0].get(name) == rules[1].get(name) for name in OF_A_LAP_TIME)


def comparable_with(evaluation: Evaluation, reader: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """Visible finished runs on the same track and in the same direction. Twin of :func:`refuse_incomparable`."""
    runs = evaluations_visible_to(reader).filter(track_id=evaluation.track_id, state=State.FINISHED)
    direction = direction_of(evaluation)
    driven = Q(spec__rules__direction=direction)
    if direction == _CCW:
        driven |= Q(spec__rules__direction=None)
    return runs.filter(driven, result__isnull=False).exclude(pk=evaluation.pk).select_related("result")


def refuse_incomparable(evaluation: Evaluation, other: Evaluation) -> None:
    """Raises UserFault ``compare_itself``, ``compare_no_result`` or ``compare_elsewhere``."""
    if evaluation.pk == other.pk:
        raise UserFault("compare_itself")
    if not (evaluation.state == other.state == State.FINISHED):
        raise UserFault("compare_no_result")
    if (evaluation.track_id, direction_of(evaluation)) != (other.track_id, direction_of(other)):
        raise UserFault("compare_elsewhere")


def offers_to_compare(
    evaluation: Evaluation, reader: Racer | AnonymousUser | None, race: Race | None
) -> list[RunOffer]:
    """The offered runs, each once: the leader's of ``race``, the reader's, house cars' and the fastest by the same
    rules."""
    runs = (
        comparable_with(evaluation, reader)
        .select_related("result", "submission__entry__race")
        .defer("result__trajectory", "track__npy")
    )
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
    if reader is not None and reader.is_authenticated:
        kinds.append((Why.MINE, ranked.filter(owner=reader.pk)[:OFFERED]))
    kinds.append((Why.HOUSE, alike.filter(owner__is_house=True)[:OFFERED]))
    kinds.append((Why.FAST, alike[:OFFERED]))
    found: dict[int, RunOffer] = {}
    mine = evaluation.result.best_lap_ms
    for why, some in kinds:
        for each in some:
            theirs = each.result.best_lap_ms
            gap = None if mine is None or theirs is None or not same_rules(evaluation, each) else theirs - mine
            submission = getattr(each, "submission", None)
            found.setdefault(each.pk, RunOffer(why, each, gap, submission.entry.race if submission else None))
    return list(found.values())
