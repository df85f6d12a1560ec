"""With which runs a run can be compared, and which of them are offered."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from django.db.models import F, Q, QuerySet

from evaluation.models import Evaluation, State
from paddock.errors import UserFault

from ..models import Race
from .visibility import evaluations_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

OFFERED = 10  # of each kind but the leader
_CCW = "ccw"


class Why(StrEnum):
    """Why a run is offered."""

    LEADER = "leader"
    MINE = "mine"
    HOUSE = "house"
    FAST = "fast"


@dataclass(frozen=True)
class RunOffer:
    """A run to compare with. ``gap_ms``: how much slower its best lap is, None where one of them has none."""

    why: Why
    evaluation: Evaluation
    gap_ms: int | None


def direction_of(evaluation: Evaluation) -> str:
    """The direction in which a run was driven."""
    return evaluation.spec["rules"].get("direction", _CCW)


def comparable_with(evaluation: Evaluation, reader: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """The other runs on the same track and in the same direction that the reader may see, with their results. Twin of
    :func:`refuse_incomparable`."""
    runs = evaluations_visible_to(reader).filter(track_id=evaluation.track_id, state=State.FINISHED)
    direction = direction_of(evaluation)
    driven = Q(spec__rules__direction=direction)
    if direction == _CCW:
        driven |= Q(spec__rules__direction=None)
    return runs.filter(driven, result__isnull=False).exclude(pk=evaluation.pk).select_related("result")


def refuse_incomparable(evaluation: Evaluation, other: Evaluation) -> None:
    """Raises UserFault ``compare_itself``, ``compare_no_result`` or ``compare_elsewhere`` for two runs that the reader
    may see but that cannot be compared."""
    if evaluation.pk == other.pk:
        raise UserFault("compare_itself")
    if not (evaluation.state == other.state == State.FINISHED):
        raise UserFault("compare_no_result")
    if (evaluation.track_id, direction_of(evaluation)) != (other.track_id, direction_of(other)):
        raise UserFault("compare_elsewhere")


def offers_to_compare(
    evaluation: Evaluation, reader: Racer | AnonymousUser | None, race: Race | None
) -> list[RunOffer]:
    """What is offered: the leader of ``race``, the reader's own, house cars', then the fastest of all others; each
    once, by their best laps. At most four queries."""
    runs = comparable_with(evaluation, reader).defer("result__trajectory", "track__npy")
    ranked = runs.filter(result__best_lap_ms__isnull=False).order_by("result__best_lap_ms", "pk")
    kinds: list[tuple[Why, QuerySet[Evaluation]]] = []
    if race is not None:
        counted = runs.filter(submission__entry__race=race, submission__entry__best=F("submission__pk"))
        board = ("submission__entry__rank_score", "submission__entry__rank_lap", "submission__entry__resets")
        kinds.append((Why.LEADER, counted.order_by(*board, "submission__entry__achieved_at")[:1]))
    if reader is not None and reader.is_authenticated:
        kinds.append((Why.MINE, ranked.filter(owner=reader.pk)[:OFFERED]))
    kinds.append((Why.HOUSE, ranked.filter(owner__is_house=True)[:OFFERED]))
    kinds.append((Why.FAST, ranked[:OFFERED]))
    found: dict[int, RunOffer] = {}
    mine = evaluation.result.best_lap_ms
    for why, some in kinds:
        for each in some:
            theirs = each.result.best_lap_ms
            gap = None if mine is None or theirs is None else theirs - mine
            found.setdefault(each.pk, RunOffer(why, each, gap))
    return list(found.values())
