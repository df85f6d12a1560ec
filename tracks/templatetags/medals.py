"""Medals on pages."""

from django import template
from django.template import Context
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _

from tracks.models import ReferenceLap, Track
from tracks.reference.medals import Medal, medal_times
from tracks.reference.selectors import Times, reference_times, references_on

register = template.Library()
_KEPT = "_reference_times"


@register.filter
def medal_badge(medal: Medal | None) -> SafeString | str:
    """A medal as a coloured disc with its name for screen readers; ``""`` for none."""
    if medal is None:
        return ""
    name = _("%(medal)s medal") % {"medal": medal.label}
    return format_html(
        '<span class="medal {}" title="{}"><span class="hidden">{}</span></span>', medal.value, name, name
    )


def times_of(context: Context) -> Times:
    """The times of all references, read once for a page, or for a context without a request."""
    request = context.get("request")
    kept = vars(request) if request is not None else context.dicts[0]
    if _KEPT not in kept:
        kept[_KEPT] = reference_times()
    times: Times = kept[_KEPT]
    return times


@register.simple_tag
def references(track: Track) -> list[tuple[ReferenceLap, list[tuple[Medal, int]]]]:
    """The references of a track, each with the slowest lap of each medal."""
    return [(each, list(medal_times(each.time_ms or 0).items())) for each in references_on(track)]
