"""Groups of racers, such as a school or a club. The leader confirms members."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import MultiLineField, OneLineField

from .access import new_code


class RacerGroup(models.Model):
    """A group of racers, visible to members, or to everybody if listed. ``code``: secret part of the link to join."""

    slug = models.SlugField(_("address"), unique=True, max_length=48)
    name = OneLineField(_("name"), max_length=64)
    description = MultiLineField(_("description"), blank=True, max_length=500)
    leader = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="groups_led",
        verbose_name=_("leader"),
    )
    is_listed = models.BooleanField(
        _("listed"),
        default=False,
        help_text=_("Public: anyone can see the group and its members, and filter boards by it."),
    )
    code = models.CharField(_("code"), max_length=32, unique=True, default=new_code, editable=False)
    made_at = models.DateTimeField(_("created"))

    class Meta:
        verbose_name = _("group of racers")
        verbose_name_plural = _("groups of racers")
        ordering = ["name", "pk"]
        constraints = [models.CheckConstraint(condition=~Q(name=""), name="racer_group_has_a_name")]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("group", args=[self.slug])


class GroupMember(models.Model):
    """A racer asks to be in a group, and is once its leader has confirmed it."""

    group = models.ForeignKey(RacerGroup, models.CASCADE, related_name="members", verbose_name=_("group"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="group_memberships", verbose_name=_("racer")
    )
    asked_at = models.DateTimeField(_("asked"))
    confirmed_at = models.DateTimeField(_("confirmed"), null=True, blank=True)
    confirmed_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("by")
    )

    class Meta:
        verbose_name = _("member of a group")
        verbose_name_plural = _("members of groups")
        ordering = ["pk"]
        constraints = [models.UniqueConstraint(fields=["group", "racer"], name="group_member_once")]

    def __str__(self) -> str:
        return f"{self.group}: {self.racer}"
