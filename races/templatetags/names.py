"""Names of races and seasons on pages."""

from django import template

from races.models import Race
from races.web.names import named, names_track

register = template.Library()
register.filter(named)


@register.filter
def names_its_track(race: Race) -> bool:
    """Whether the race's name contains its track's name."""
    return names_track(race.name, race.track.name)
