"""What an organiser or the clock did in a live event, in words."""

from __future__ import annotations

from django import template
from django.utils.translation import gettext_lazy as _

register = template.Library()

# by what LiveLog.action holds; one stands before the racer whom it concerns, where there is one
ACTS = {
    "add": _("added"),
    "again": _("has run again"),
    "auto": _("changed whether runs start by themselves"),
    "begin": _("began the event"),
    "call": _("called"),
    "cancel": _("took the event back"),
    "end": _("ended the event"),
    "hold": _("holds back"),
    "interrupt": _("interrupted by an outage of the site"),
    "launch": _("launched"),
    "message": _("sent a message to spectators"),
    "move": _("moved in the running order"),
    "pause": _("paused"),
    "plan": _("planned the event"),
    "podium": _("showed the podium"),
    "release": _("lets run after all"),
    "remove": _("removed"),
    "resume": _("went on"),
    "skip": _("skipped"),
    "submissions": _("changed whether models are taken"),
    "undo": _("took back"),
    "winner": _("named the winner"),
}


@register.filter
def act(action: str) -> str:
    """``launch`` as "launched"."""
    return str(ACTS.get(action, action))
