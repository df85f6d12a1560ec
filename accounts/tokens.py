"""API tokens of a racer. A token's text is shown once; only its digest is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db import transaction
from django.db.models import QuerySet
from knox.models import AuthToken, get_token_model

from faults import UserFault

if TYPE_CHECKING:
    from league.models import Racer

TOKENS_PER_RACER = 20


def tokens_of(racer: Racer) -> QuerySet[AuthToken]:
    """The racer's tokens, newest first."""
    return get_token_model().objects.filter(user=racer).order_by("-created")


@transaction.atomic
def create_token(*, racer: Racer) -> str:
    """A new token's text, never to be seen again. Raises UserFault ``too_many_tokens``."""
    if tokens_of(racer).count() >= TOKENS_PER_RACER:
        raise UserFault("too_many_tokens", limit=TOKENS_PER_RACER)
    return get_token_model().objects.create(user=racer)[1]


def revoke_token(*, racer: Racer, key: str) -> bool:
    """Revoke the racer's token that starts with ``key``; False when there is none."""
    return bool(tokens_of(racer).filter(token_key=key).delete()[0])
