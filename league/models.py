"""Racers, seasons and rounds."""

from __future__ import annotations

from django.contrib.auth.models import AbstractBaseUser, BaseUserManager, PermissionsMixin
from django.core.exceptions import ValidationError
from django.core.validators import RegexValidator
from django.db import models
from django.db.models.functions import Lower
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from races.models import Division, Kind

ALIAS_PATTERN = r"^[A-Za-z0-9_-]{2,64}$"
ALIAS_VALIDATORS = [
    RegexValidator(ALIAS_PATTERN, _("Use 2 to 64 letters, digits, hyphens and underscores."), code="alias"),
]


class RacerManager(BaseUserManager["Racer"]):
    """Makes racers; e-mail addresses are stored in lower case, so that one address is one account."""

    def create_user(self, alias: str, email: str, password: str | None = None, **fields) -> Racer:
        """A racer who may log in. Without ``password`` the account cannot be logged in to."""
        racer = self.model(alias=alias, email=email.lower(), **fields)
        racer.set_password(password)
        racer.save(using=self._db)
        return racer

    def create_superuser(self, alias: str, email: str, password: str | None = None, **fields) -> Racer:
        """An admin with every permission."""
        return self.create_user(alias, email, password, is_staff=True, is_superuser=True, **fields)

    def get_by_natural_key(self, alias: str | None) -> Racer:
        return self.get(alias__iexact=alias)


class Racer(AbstractBaseUser, PermissionsMixin):
    """Somebody who races. The alias is what everybody sees; the e-mail address is seen by its owner and admins only.

    House cars belong to racers with ``is_house``: they cannot log in and are never ranked.
    """

    alias = models.CharField(_("alias"), max_length=64, unique=True, validators=ALIAS_VALIDATORS)
    email = models.EmailField(_("e-mail address"), unique=True)
    country = models.CharField(_("country"), max_length=2, blank=True, help_text=_("Two-letter code, such as KR."))
    is_house = models.BooleanField(_("house car"), default=False)
    is_staff = models.BooleanField(_("admin"), default=False)
    is_active = models.BooleanField(_("active"), default=True)
    joined_at = models.DateTimeField(_("joined"), default=timezone.now)

    objects = RacerManager()

    USERNAME_FIELD = "alias"
    EMAIL_FIELD = "email"
    REQUIRED_FIELDS = ["email"]

    class Meta:
        verbose_name = _("racer")
        verbose_name_plural = _("racers")
        constraints = [
            models.UniqueConstraint(Lower("alias"), name="racer_alias_unique_in_any_case"),
            models.CheckConstraint(condition=models.Q(alias__regex=ALIAS_PATTERN), name="racer_alias_form"),
            models.CheckConstraint(condition=models.Q(country__regex=r"^([A-Z]{2})?$"), name="racer_country_form"),
            models.CheckConstraint(
                condition=models.Q(is_house=False) | models.Q(is_staff=False), name="racer_house_is_no_admin"
            ),
        ]

    def __str__(self) -> str:
        return self.alias

    def get_absolute_url(self) -> str:
        return reverse("racer", args=[self.alias])


class Season(models.Model):
    """A year of monthly rounds. ``ends_on`` is its last day."""

    slug = models.SlugField(_("address"), unique=True)
    name = models.CharField(_("name"), max_length=64)
    starts_on = models.DateField(_("starts"))
    ends_on = models.DateField(_("ends"))

    class Meta:
        verbose_name = _("season")
        verbose_name_plural = _("seasons")
        ordering = ["-starts_on"]
        constraints = [
            models.CheckConstraint(
                condition=models.Q(ends_on__gt=models.F("starts_on")),
                name="season_ends_after_start",
                violation_error_message=_("The season ends before it starts. Choose a later last day."),
            ),
        ]

    def __str__(self) -> str:
        return self.name


class Round(models.Model):
    """One division's race of one month of a season."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="rounds", verbose_name=_("season"))
    number = models.PositiveSmallIntegerField(_("number"))
    race = models.OneToOneField("races.Race", models.PROTECT, related_name="round", verbose_name=_("race"))

    class Meta:
        verbose_name = _("round")
        verbose_name_plural = _("rounds")
        ordering = ["season", "number"]
        constraints = [
            models.CheckConstraint(condition=models.Q(number__gte=1), name="round_number_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.season} · {self.number}"

    def clean(self) -> None:
        """A round is a race of the league, and one division has one race in a round."""
        if self.race_id is None:
            return
        if self.race.kind != Kind.LEAGUE:
            raise ValidationError({"race": _("Only a league race can be a round. This is a community race.")})
        if self.season_id is None:  # a season that is made together with its rounds
            return
        same = Round.objects.filter(season=self.season, number=self.number, race__division=self.race.division)
        if same.exclude(pk=self.pk).exists():
            raise ValidationError({"number": _("This division already has a race in this round of the season.")})


class Membership(models.Model):
    """A racer's division in a season. Who has none is in the open division, where everybody starts."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="memberships", verbose_name=_("season"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="memberships", verbose_name=_("racer"))
    division = models.CharField(_("division"), max_length=4, choices=Division.choices, default=Division.PRO)
    since = models.DateTimeField(_("since"), default=timezone.now)

    class Meta:
        verbose_name = _("division of a racer")
        verbose_name_plural = _("divisions of racers")
        ordering = ["season", "division", "racer"]
        constraints = [
            models.UniqueConstraint(fields=["season", "racer"], name="membership_one_division_a_season"),
            models.CheckConstraint(condition=models.Q(division__in=Division.values), name="membership_division_known"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.get_division_display()} · {self.season}"
