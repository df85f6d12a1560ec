"""Names of races and seasons on pages."""

from __future__ import annotations

from django import template

from races import names
from races.models import Race

register = template.Library()


@register.filter
def named(text: str) -> str:
    """A name in the reader's language, where the house gave it."""
    return names.named(text)


@register.filter
def names_its_track(race: Race) -> bool:
    """Whether the race's name says its track's."""
    return names.names_track(race.name, race.track.name)
