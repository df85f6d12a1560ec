"""The words that a race chooses from."""

from typing import Any

from django.db import models
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import INNER, OUTER, RANKING_METHODS


class RaceKind(models.TextChoices):
    LEAGUE = "league", _("league")
    COMMUNITY = "community", _("community")


class Division(models.TextChoices):
    """Whose a league race is: a division's, or everybody's. Community races have none."""

    OPEN = "open", _("open division")
    PRO = "pro", _("pro division")
    ALL = "all", _("all divisions")


class RaceType(models.TextChoices):
    TIME_TRIAL = "time_trial", _("time trial")
    OBJECT_AVOIDANCE = "object_avoidance", _("object avoidance")
    HEAD_TO_HEAD = "head_to_head", _("head-to-head")


class Opponents(models.TextChoices):
    """The opponents in a head-to-head race. Other races have none."""

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


# Names of the ranking methods for code; fields take their choices from ranking_choices.
RankingMethod: Any = models.TextChoices(  # type: ignore[call-overload]
    "RankingMethod", [(rule.code.upper(), (rule.code, rule.label)) for rule in RANKING_METHODS.values()]
)


def ranking_choices() -> list[tuple[str, Any]]:
    return [(rule.code, rule.label) for rule in RANKING_METHODS.values()]


class Visibility(models.TextChoices):
    PUBLIC = "public", _("public")
    INVITATION = "invitation", _("by invitation link")


class TeamEntries(models.TextChoices):
    NONE = "", _("teams play no part")
    SEVERAL = "several", _("for teams, with any number of cars each")
    ONE = "one", _("for teams, with one car each")


class RaceState(models.TextChoices):
    """A function of the time, never a column."""

    UPCOMING = "upcoming", _("upcoming")
    OPEN = "open", _("open")
    CLOSED = "closed", _("closed")
    CANCELLED = "cancelled", _("cancelled")
