"""A nonce in a form that detects a second submission: a double click, or a reload of the answer."""

import secrets

from django.core.cache import cache

REMEMBERED_S = 86_400
FIELD = "once"
_MOST = 64


def new_nonce() -> str:
    """A unique value for the form's hidden field :data:`FIELD`."""
    return secrets.token_urlsafe(12)


def claim(nonce: str) -> bool:
    """Whether this nonce arrives for the first time in a day. True without a nonce, and while the cache is down."""
    key = f"once-{nonce}"
    return not nonce or len(nonce) > _MOST or cache.add(key, 1, REMEMBERED_S) or cache.get(key) is None


def release(nonce: str) -> None:
    """Allow the nonce again: the form was refused."""
    cache.delete(f"once-{nonce}")
