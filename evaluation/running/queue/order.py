"""The order of the queue.

Higher priority first. Within a priority, racers take turns: an evaluation gets the number of a round when it is queued,
its *turn*, and lower turns run first; within a turn, the earlier one. A racer has one evaluation in a round: the first
joins the round that is being run, each further one the round after that of the one before. Once nothing of a priority
waits or runs, the next round begins. (Start-time fair queueing, where each evaluation counts as one.)

A turn never changes while an evaluation waits, so the order is an index. The place is exact within the first
:data:`FRONT`. Evaluations of :data:`BACKGROUND` run when there is nothing else to run. For :data:`URGENT` see
:mod:`evaluation.running.queue.turns`.
"""

from collections.abc import Iterable
from typing import Any

from django.contrib.auth import get_user_model
from django.db.models import OuterRef, QuerySet, Subquery

from core.database.kept_queries import KeptQuery

from ...models import Evaluation, State

OWN = -5  # a racer's own runs: behind what races wait for, before what nobody waits for
BACKGROUND = -20  # the lowest priority there is
URGENT = 10
FRONT = 1000  # the places that are exact
ORDER = ("-priority", "turn", "queued_at", "pk")


def front_of_queue() -> list[int]:
    """The ids of the first :data:`FRONT` queued evaluations in the order in which they will run if nothing else is
    queued."""
    return list(queued().order_by(*ORDER).values_list("pk", flat=True)[:FRONT])


def queued() -> QuerySet[Evaluation]:
    return Evaluation.with_sealed.filter(state=State.QUEUED).order_by()


def next_turns(owners: Iterable[int], priority: int) -> list[int]:
    """The turns of evaluations that are about to be queued at a priority, one for each of ``owners`` (ids of
    racers)."""
    owners = list(owners)
    before = _round_under_way(priority) - 1
    mine = Evaluation.with_sealed.filter(owner=OuterRef("pk"), priority=priority, turn__isnull=False).order_by("-turn")
    waiting, begun = mine.filter(state=State.QUEUED), mine.filter(started_at__isnull=False)
    racers = get_user_model().objects.filter(pk__in=set(owners)).order_by()
    last = racers.annotate(waiting=Subquery(waiting.values("turn")[:1]), begun=Subquery(begun.values("turn")[:1]))
    of_owner = {
        owner: max([before, *(turn for turn in turns if turn is not None)])
        for owner, *turns in last.values_list("pk", "waiting", "begun")
    }
    turns = []
    for owner in owners:
        of_owner[owner] += 1
        turns.append(of_owner[owner])
    return turns


def _round_under_way(priority: int) -> int:
    """The turn of a racer who has nothing in the queue and had nothing in this round."""
    begun = max(_begun(priority=priority), default=-1)
    if begun >= 0 and _driving(priority=priority):
        return begun
    waiting = _waiting(priority=priority)
    return max(begun, *waiting) if waiting else begun + 1


def _turns(priority: int, order: str) -> QuerySet[Evaluation, Any]:
    rows = Evaluation.with_sealed.filter(priority=priority, turn__isnull=False)
    return rows.order_by(order).values_list("turn", flat=True)


_begun: KeptQuery[int] = KeptQuery(lambda priority: _turns(priority, "-turn").filter(started_at__isnull=False)[:1])
_driving: KeptQuery[int] = KeptQuery(
    lambda priority: Evaluation.with_sealed.filter(priority=priority, state=State.RUNNING).values_list("pk", flat=True)[
        :1
    ]
)
_waiting: KeptQuery[int] = KeptQuery(lambda priority: _turns(priority, "turn").filter(state=State.QUEUED)[:1])
