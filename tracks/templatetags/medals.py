"""Medals on pages."""

from django import template
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _

from tracks.models import ReferenceLap, Track
from tracks.reference.medals import Medal, medal_times
from tracks.reference.selectors import references_on

register = template.Library()


@register.filter
def medal_badge(medal: Medal | None) -> SafeString | str:
    """A medal as a coloured disc with its name for screen readers; ``""`` for none."""
    if medal is None:
        return ""
    name = _("%(medal)s medal") % {"medal": medal.label}
    return format_html(
        '<span class="medal {}" title="{}"><span class="hidden">{}</span></span>', medal.value, name, name
    )


@register.simple_tag
def references(track: Track) -> list[tuple[ReferenceLap, list[tuple[Medal, int]]]]:
    """The references of a track, each with the slowest lap of each medal."""
    return [(each, list(medal_times(each.time_ms or 0).items())) for each in references_on(track)]
