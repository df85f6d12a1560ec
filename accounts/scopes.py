"""What a token may be made for. Each operation of the API needs one scope; a program is given no more than it needs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from django.utils.translation import gettext_lazy as _

READ, RACE, TRAIN, ORGANISE = "read", "race", "train", "organise"
SCOPES = (READ, RACE, TRAIN, ORGANISE)
LABELS = {
    READ: _("read: read everything you can see"),
    RACE: _("race: upload models, enter races and submit cars"),
    TRAIN: _("train: start trainings, edit vehicles"),
    ORGANISE: _("organise: create and edit races, seasons, tracks and webhooks"),
}
# What a view says in place of a scope: any token will do, or only one that may do everything
ANY, EVERY = "any", "every"
SAFE = ("GET", "HEAD", "OPTIONS")


def needed(view: Any, method: str) -> tuple[str, ...]:
    """The scopes that a token must have for this method of a view of the API.

    A view says ``token_scope`` for what it writes; one that says nothing is open only to tokens with all of them.
    """
    if method in SAFE:
        return (READ,)
    said = getattr(view, "token_scope", EVERY)
    return {ANY: (), EVERY: SCOPES}.get(said, (said,))


def in_order(scopes: Iterable[str]) -> list[str]:
    """These scopes as they are always listed."""
    chosen = set(scopes)
    return [scope for scope in SCOPES if scope in chosen]
