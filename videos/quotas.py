"""The quotas of videos and the size of their files."""

from datetime import datetime, timedelta

from django.conf import settings
from django.db.models import Count, QuerySet, Sum
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, only
from accounts.usage.storage import Shelf

from .models import UNDER_WAY, Video

A_DAY = timedelta(days=1)


def _videos_at_once(racers: Racers, now: datetime) -> CountedRows:
    waiting = _videos(racers).filter(state__in=UNDER_WAY)
    return waiting.order_by().values_list("asked_by").annotate(Count("pk"))


def _videos_a_day(racers: Racers, now: datetime) -> CountedRows:
    """The requests of each racer in the 24 hours before ``now``."""
    asked = _videos(racers).filter(asked_at__gt=now - A_DAY)
    return asked.order_by().values_list("asked_by").annotate(Sum("asks"))


def _videos(racers: Racers) -> QuerySet[Video]:
    return only(Video.objects.exclude(asked_by=None), "asked_by", racers)


def _video_files(racers: Racers) -> list[CountedRows]:
    return [_videos(racers).filter(size__gt=0).order_by().values_list("asked_by").annotate(Sum("size"))]


def _have_videos() -> bool:
    return settings.VIDEOS


VIDEOS_AT_ONCE = Quota(7, "videos_at_once", "VIDEOS_AT_ONCE", _("Videos in progress"), _videos_at_once, _have_videos)
VIDEOS_A_DAY = Quota(8, "videos_a_day", "VIDEOS_A_DAY", _("Videos in 24 hours"), _videos_a_day, _have_videos)
VIDEO_FILES = Shelf(4, "videos", _("Videos"), _video_files)
