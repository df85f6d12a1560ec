"""Spectators react: counted, and no more than a person does."""

from __future__ import annotations

from datetime import datetime

from django.core.cache import cache
from django.db import IntegrityError, transaction
from django.db.models import F

from paddock.errors import UserFault

from ...models import LiveEvent, LiveReaction, ReactionKind
from ...selectors.live_reactions import takes_reactions

WINDOW_S = 10
MOST_IN_A_WINDOW = 8
MOST_OF_AN_ADDRESS = 240  # a school behind one address


def react(*, event: LiveEvent, kind: str, session: str, address: str, now: datetime) -> None:
    """Count a reaction of the spectator with this session key, at this network address.

    Raises UserFault ``live_reaction_unknown``, ``live_reactions_closed`` before the lobby and after the show,
    ``live_reactions_too_many``.
    """
    if kind not in ReactionKind.values:
        raise UserFault("live_reaction_unknown", known=", ".join(ReactionKind.values))
    if not takes_reactions(event, now):
        raise UserFault("live_reactions_closed")
    window = int(now.timestamp()) // WINDOW_S
    for who, most in ((f"s:{session}", MOST_IN_A_WINDOW), (f"a:{address}", MOST_OF_AN_ADDRESS)):
        if _counted(f"live-react:{event.pk}:{who}:{window}") > most:
            raise UserFault("live_reactions_too_many")
    rows = LiveReaction.objects.filter(event=event, kind=kind)
    if rows.update(count=F("count") + 1):
        return
    try:
        with transaction.atomic():
            LiveReaction.objects.create(event=event, kind=kind, count=1)
    except IntegrityError:  # somebody else was the first
        rows.update(count=F("count") + 1)


def _counted(key: str) -> int:
    cache.add(key, 0, 2 * WINDOW_S)
    try:
        return cache.incr(key)
    except ValueError:  # it ran out in between
        return 1
