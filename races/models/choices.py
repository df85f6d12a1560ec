"""The words that a race chooses from."""

from __future__ import annotations

from django.db import models
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import INNER, OUTER


class RaceKind(models.TextChoices):
    """Who holds a race."""

    LEAGUE = "league", _("league")
    COMMUNITY = "community", _("community")


class Division(models.TextChoices):
    """Whose a league race is: a division's, or everybody's. Community races have none."""

    OPEN = "open", _("open division")
    PRO = "pro", _("pro division")
    ALL = "all", _("all divisions")


class RaceType(models.TextChoices):
    """What stands or drives on the track besides the car."""

    TIME_TRIAL = "time_trial", _("time trial")
    OBJECT_AVOIDANCE = "object_avoidance", _("object avoidance")
    HEAD_TO_HEAD = "head_to_head", _("head-to-head")


class Opponents(models.TextChoices):
    """Whom a head-to-head race is driven against. Other races have none."""

    BOTS = "bots", _("bot cars")
    MODELS = "models", _("the other racers' cars")


class DuelFormat(models.TextChoices):
    """How a race of models against models pairs its cars once it has closed. Other races have none."""

    ROUND_ROBIN = "round_robin", _("round robin")
    BRACKET = "bracket", _("bracket")


class Lane(models.TextChoices):
    """Of a track's two lanes: beside the inner border or beside the outer border, in either direction."""

    INNER = INNER, _("inner lane")
    OUTER = OUTER, _("outer lane")


class RankingMethod(models.TextChoices):
    """What a board ranks by. The rules are the classes in races.ranking."""

    AVERAGE = "average", _("average lap")
    BEST = "best", _("best lap")
    TOTAL = "total", _("total time")


class Visibility(models.TextChoices):
    """Who sees a race and may join it."""

    PUBLIC = "public", _("public")
    INVITATION = "invitation", _("by invitation link")


class TeamEntries(models.TextChoices):
    """What teams are in a race."""

    NONE = "", _("teams play no part")
    SEVERAL = "several", _("for teams, with any number of cars each")
    ONE = "one", _("for teams, with one car each")


class RaceState(models.TextChoices):
    """A function of the time, never a column."""

    UPCOMING = "upcoming", _("upcoming")
    OPEN = "open", _("open")
    CLOSED = "closed", _("closed")
    CANCELLED = "cancelled", _("cancelled")
