"""Signs of life of the stream process, for the health page, ``doctor`` and live events: from any machine, through the
cache."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.core.cache import cache

from ..clock import database_now

KEY = "streams"
TOLD_EVERY_S = 2.0
LIVES_S = 35  # without another sign
FRESH_S = 4.0  # a sign of a process that lives now is no older
_process: dict[str, float] = {}


def tell(figures: dict[str, Any]) -> None:
    """Leave a sign of life: what :meth:`config.streams.hub.Hub.figures` says. Of several processes the
    last one's stands."""
    now = database_now().timestamp()
    began = _process.setdefault("began", now)
    cache.set(KEY, figures | {"began": began, "at": now}, LIVES_S)


def told() -> dict[str, Any] | None:
    """The last sign; None where no stream process lives."""
    return cache.get(KEY)


def lived_through(since: datetime, now: datetime) -> bool:
    """Whether one stream process has lived from ``since`` until ``now``, by the database's clock."""
    sign = told()
    return sign is not None and sign["began"] <= since.timestamp() and sign["at"] >= now.timestamp() - FRESH_S
