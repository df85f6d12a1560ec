"""That a stream process lives, as the health page and ``doctor`` see it: from any machine, through the cache."""

from __future__ import annotations

from typing import Any

from django.core.cache import cache

KEY = "streams"
TOLD_EVERY_S = 10.0
LIVES_S = 35  # without another sign


def tell(figures: dict[str, Any]) -> None:
    """Leave a sign of life: what :meth:`config.streams.hub.Hub.figures` says. Of several processes the
    last one's stands."""
    cache.set(KEY, figures, LIVES_S)


def told() -> dict[str, Any] | None:
    """The last sign; None where no stream process lives."""
    return cache.get(KEY)
