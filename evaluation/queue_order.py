"""The order of the queue.

Higher priority first. Within a priority, racers take turns: every evaluation is given the number of a round when it is
queued, its *turn*, and lower turns run first; within a turn, what was queued earlier. A racer has one evaluation in a
round: the first of them joins the round that is being run, each further one the round after that of the one before,
also when that one has ended meanwhile. Once nothing of a priority waits or runs, the next round begins for everybody.

So one submission each is first come, first served, with any number of workers; fifty submissions of one racer do not
keep a newcomer waiting for more than one of them; and racers who send one car after the other do not keep the second
car of another waiting either. (Start-time fair queueing, where each evaluation counts as one.)

A turn never changes while an evaluation waits, also when it was claimed and came back. So the order is an index, and
neither a claim nor a place costs more in a longer queue. The place is exact within the first :data:`FRONT`; of what is
farther behind is only said that it is.

What nobody waits for (:data:`BACKGROUND`) runs when nothing else is there to run. What :data:`URGENT` is for is told in
:mod:`evaluation.services.turns`.
"""

from __future__ import annotations

from collections.abc import Iterable

from django.contrib.auth import get_user_model
from django.db.models import Max, Min, OuterRef, QuerySet, Subquery

from .models import Evaluation, State

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
    """All queued evaluations, unordered."""
    return Evaluation.with_sealed.filter(state=State.QUEUED).order_by()


def next_turns(owners: Iterable[int], priority: int) -> list[int]:
    """The turns of evaluations that are about to be queued at a priority, one for each of ``owners`` (ids of racers, in
    order, as often as they have one)."""
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
    rows = Evaluation.with_sealed.filter(priority=priority).order_by()
    begun = rows.filter(started_at__isnull=False).aggregate(turn=Max("turn"))["turn"]
    begun = -1 if begun is None else begun
    if begun >= 0 and rows.filter(state=State.RUNNING).exists():
        return begun
    waiting = rows.filter(state=State.QUEUED).aggregate(turn=Min("turn"))["turn"]
    return begun + 1 if waiting is None else max(begun, waiting)
