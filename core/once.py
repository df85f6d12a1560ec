"""Forms that must not be sent twice: by a double click, or by reloading the page that answered them."""

from __future__ import annotations

import secrets

from django.core.cache import cache

REMEMBERED_S = 86_400
FIELD = "once"
_MOST = 64


def new_once() -> str:
    """What a form says in its hidden field :data:`FIELD`: no two forms the same."""
    return secrets.token_urlsafe(12)


def first_time(said: str) -> bool:
    """Whether a form that says this is sent for the first time in a day. True for one that says nothing, and while the
    cache is away."""
    key = f"once-{said}"
    return not said or len(said) > _MOST or cache.add(key, 1, REMEMBERED_S) or cache.get(key) is None


def not_this_time(said: str) -> None:
    """What the form asked for was refused: it may be sent again."""
    cache.delete(f"once-{said}")
