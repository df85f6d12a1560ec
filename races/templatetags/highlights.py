"""The video of a live event's highlights, on its page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from django import template
from django.conf import settings
from django.db.models import Q
from django.template import Context

from evaluation.models import Evaluation
from races.models import LiveEvent
from videos.models import REEL, Video
from videos.reel import length_of
from videos.responses import page_language
from videos.selectors import ShownVideo, shown_video

register = template.Library()
_RELATED = ("evaluation__result", "evaluation__track", "evaluation__owner", "evaluation__model", "asked_by")


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
    runs = Evaluation.objects.filter(Q(live_slot__event=event) | Q(duel__race=event.race)).values("pk")
    videos = Video.objects.filter(part=REEL, evaluation__in=runs, language=page_language())
    video = videos.select_related(*_RELATED).order_by("-asked_at", "-pk").first()
    user: Any = getattr(context.get("request"), "user", None)
    moments, at = [], 0
    for told in (video.segments or ()) if video is not None else ():
        moments.append((at, told["caption"]))
        at += length_of(told)
    can_ask = settings.VIDEOS and user is not None and user.is_authenticated
    return Highlights(None if video is None else shown_video(video), moments, can_ask)
