"""Teams: a captain, members and open invitations."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from .access import new_code


def team_key(name: str) -> str:
    """What two spellings of one team have in common: neither letter case nor blanks make another team."""
    return " ".join(name.split()).casefold()


class Team(models.Model):
    """Racers under one name. ``key``: the name as it is compared; ``code``: secret part of the link to join."""

    slug = models.SlugField(_("address"), unique=True, max_length=48)
    name = OneLineField(_("name"), max_length=64)
    key = models.CharField(max_length=200, unique=True, editable=False)
    captain = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("captain")
    )
    code = models.CharField(_("code"), max_length=32, unique=True, default=new_code, editable=False)
    made_at = models.DateTimeField(_("created"))

    class Meta:
        verbose_name = _("team")
        verbose_name_plural = _("teams")
        ordering = ["name", "pk"]
        constraints = [models.CheckConstraint(condition=~Q(key=""), name="team_has_a_name")]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("team", args=[self.slug])


class TeamMember(models.Model):
    """A racer is in one team at most."""

    racer = models.OneToOneField(
        settings.AUTH_USER_MODEL,
        models.CASCADE,
        primary_key=True,
        related_name="team_membership",
        verbose_name=_("racer"),
    )
    team = models.ForeignKey(Team, models.CASCADE, related_name="members", verbose_name=_("team"))
    joined_at = models.DateTimeField(_("joined"))

    class Meta:
        verbose_name = _("member of a team")
        verbose_name_plural = _("members of teams")

    def __str__(self) -> str:
        return f"{self.team}: {self.racer_id}"


class TeamInvitation(models.Model):
    """A captain asks a racer to join."""

    team = models.ForeignKey(Team, models.CASCADE, related_name="invitations", verbose_name=_("team"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="team_invitations", verbose_name=_("racer")
    )
    made_at = models.DateTimeField(_("created"))

    class Meta:
        verbose_name = _("invitation to a team")
        verbose_name_plural = _("invitations to teams")
        constraints = [models.UniqueConstraint(fields=["team", "racer"], name="team_invitation_once")]

    def __str__(self) -> str:
        return f"{self.team}: {self.racer_id}"
