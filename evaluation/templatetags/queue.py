"""What pages say of a place in the queue."""

import math

from django import template
from django.utils.formats import number_format
from django.utils.translation import gettext as _

from evaluation.running.queue.order import FRONT

register = template.Library()


@register.filter
def in_queue(position: int | None) -> str:
    """A place in the queue as a sentence; ``""`` for none."""
    if not position:
        return ""
    if position == 1:
        return _("In queue: next.")
    if position > FRONT:
        return _("In queue: after the first %(count)s.") % {"count": number_format(FRONT, force_grouping=True)}
    return _("In queue: number %(position)s.") % {"position": position}


@register.filter
def place(position: int | None) -> str:
    """A place in the queue as short as can be."""
    if not position:
        return "…"
    if position == 1:
        return _("next")
    return f"> {number_format(FRONT, force_grouping=True)}" if position > FRONT else str(position)


@register.simple_tag
def done_in(wait_s: float | None, position: int | None) -> str:
    """When a car that waits will have driven; ``""`` where there is nothing to judge by."""
    if not wait_s or not position:
        return ""
    seconds = {"seconds": math.ceil(wait_s)}
    return (_("Starts in %(seconds)s s or later.") if position > FRONT else _("Done in about %(seconds)s s.")) % seconds
