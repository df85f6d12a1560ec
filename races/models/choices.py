"""The words that a race chooses from."""

from __future__ import annotations

from django.db import models
from django.utils.translation import gettext_lazy as _


class Kind(models.TextChoices):
    """Who holds a race."""

    LEAGUE = "league", _("league")
    COMMUNITY = "community", _("community")


class Division(models.TextChoices):
    """The league's divisions. Community races have none."""

    OPEN = "open", _("open division")
    PRO = "pro", _("pro division")


class RaceType(models.TextChoices):
    """What stands or drives on the track besides the car."""

    TIME_TRIAL = "time_trial", _("time trial")


class RankingMethod(models.TextChoices):
    """What a board ranks by. The rules are the classes in races.ranking."""

    AVERAGE = "average", _("average lap")
    BEST = "best", _("best lap")
    TOTAL = "total", _("total time")


class Visibility(models.TextChoices):
    """Who sees a race and may join it."""

    PUBLIC = "public", _("public")
    INVITATION = "invitation", _("by invitation link")


class RaceState(models.TextChoices):
    """A function of the time, never a column."""

    UPCOMING = "upcoming", _("upcoming")
    OPEN = "open", _("open")
    CLOSED = "closed", _("closed")
    CANCELLED = "cancelled", _("cancelled")
