"""Which screens of a live event are open and connected: each tells so now and then."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.core.cache import cache

if TYPE_CHECKING:
    from .models import Race

CONNECTED_S = 25  # a screen tells it every ten seconds


def note_screen(race: Race, name: str) -> None:
    """A screen of the race is connected."""
    cache.set(_key(race, name), 1, CONNECTED_S)


def is_connected(race: Race, name: str) -> bool:
    """Whether a screen of this name told so lately."""
    return cache.get(_key(race, name)) is not None


def _key(race: Race, name: str) -> str:
    return f"live-screen-{race.pk}-{name}"
