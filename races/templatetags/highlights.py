"""The video of a live event's highlights, on its page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from django import template
from django.conf import settings
from django.template import Context

from races.afterwards.highlights import latest_reel
from races.models import LiveEvent
from videos.reel import length_of
from videos.responses import page_language
from videos.selectors import ShownVideo

register = template.Library()


@dataclass(frozen=True)
class Highlights:
    """``shown``: the video in the reader's language, if there is one. ``moments``: from when on (ms of it) it shows
    what."""

    shown: ShownVideo | None
    moments: list[tuple[int, str]]
    can_ask: bool


@register.simple_tag(takes_context=True)
def highlights_of(context: Context, event: LiveEvent) -> Highlights:
    """What the page of an event that has ended says of its highlights."""
    shown = latest_reel(event, page_language())
    user: Any = getattr(context.get("request"), "user", None)
    moments, at = [], 0
    for told in (shown.video.segments or ()) if shown is not None else ():
        moments.append((at, told["caption"]))
        at += length_of(told)
    can_ask = settings.VIDEOS and user is not None and user.is_authenticated
    return Highlights(shown, moments, can_ask)
