"""What a token may be made for. Each operation of the API needs one scope; a program is given no more than it needs."""

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
# Values of ``token_scope`` besides scopes: any token, or only one with all scopes
ANY, EVERY = "any", "every"
SAFE = ("GET", "HEAD", "OPTIONS")


def needed(view: Any, method: str) -> tuple[str, ...]:
    """The scopes that a token needs for this method of an API view: for writes its ``token_scope``, without one all;
    for reads its ``read_scopes``, without them READ."""
    if method in SAFE:
        return getattr(view, "read_scopes", (READ,))
    scope = getattr(view, "token_scope", EVERY)
    return {ANY: (), EVERY: SCOPES}.get(scope, (scope,))


def in_order(scopes: Iterable[str]) -> list[str]:
    chosen = set(scopes)
    return [scope for scope in SCOPES if scope in chosen]
