"""Template tags for live events: actions, speed commands and the video of the highlights."""

from dataclasses import dataclass
from typing import Any

from django import template
from django.conf import settings
from django.template import Context
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from evaluation.models import Evaluation
from races.aftermath.highlights import latest_reel
from races.live.selectors.speed import SpeedCommandDocument
from races.models import LiveEvent
from videos.responses import page_language
from videos.scenes import Reel
from videos.selectors import ShownVideo

register = template.Library()

# by the values of LiveLog.action; the text stands before the name of its racer, if any
ACTS = {
    "add": _("added"),
    "again": _("has run again"),
    "auto": _("changed the automatic start of runs"),
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


@register.filter
def speed_log(evaluation: Evaluation) -> list[SpeedCommandDocument]:
    """The commands that a run was driven with, in the order of their times."""
    return list(evaluation.spec["rules"].get("speed_commands") or ())


@register.filter
def speed_command(one: SpeedCommandDocument | None) -> str:
    if one is None or one["mode"] == "model_speed":
        return gettext("model speed")
    value = one["value"]
    words = {
        "multiplier": gettext("%(value)s × the model's speed"),
        "cap": gettext("at most %(value)s m/s"),
        "absolute": gettext("%(value)s m/s"),
        "percent_max": gettext("%(value)s %% of 4 m/s"),
        "offset": gettext("model's speed plus %(value)s m/s"),
    }
    return words[one["mode"]] % {"value": f"{value:+g}" if one["mode"] == "offset" else f"{value:g}"}


@dataclass(frozen=True)
class Highlights:
    """``shown``: the video in the reader's language, if any. ``moments``: the captions with their starts in ms."""

    shown: ShownVideo | None
    moments: list[tuple[int, str]]
    can_ask: bool


@register.simple_tag(takes_context=True)
def highlights_of(context: Context, event: LiveEvent) -> Highlights:
    shown = latest_reel(event, page_language())
    user: Any = getattr(context.get("request"), "user", None)
    moments, at = [], 0
    for segment in Reel.of(shown.video).segments if shown is not None else ():
        moments.append((at, segment.caption))
        at += segment.length_ms
    can_ask = settings.VIDEOS and user is not None and user.is_authenticated
    return Highlights(shown, moments, can_ask)
