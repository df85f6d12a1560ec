"""Reactions of spectators to a live event."""

from __future__ import annotations

from datetime import datetime, timedelta

from ..models import LiveEvent, LiveReaction, LiveState, ReactionKind

REACTIONS_AFTER = timedelta(minutes=10)  # a podium is applauded


def reactions_of(event: LiveEvent) -> dict[str, int]:
    """How often each reaction was sent, by its kind; those that nobody sent are 0."""
    sent = dict(LiveReaction.objects.filter(event=event).values_list("kind", "count"))
    return {kind.value: sent.get(kind.value, 0) for kind in ReactionKind}


def takes_reactions(event: LiveEvent, now: datetime) -> bool:
    """Whether spectators react now: from the lobby until ten minutes after the end."""
    if event.race.cancelled_at is not None:
        return False
    if event.state == LiveState.ENDED:
        return event.ended_at is not None and now < event.ended_at + REACTIONS_AFTER
    return event.state in (LiveState.RUNNING, LiveState.PAUSED) or event.in_lobby(now)
