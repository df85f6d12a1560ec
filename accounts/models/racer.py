"""Racers."""

from __future__ import annotations

from typing import Any, TypeAlias

from django.contrib.auth.models import AbstractBaseUser, AnonymousUser, BaseUserManager, PermissionsMixin
from django.core.validators import RegexValidator
from django.db import models, transaction
from django.db.models.functions import Lower
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

ALIAS_PATTERN = r"^[A-Za-z0-9_-]{2,64}$"
ALIAS_VALIDATORS = [
    RegexValidator(ALIAS_PATTERN, _("Use 2 to 64 English letters, digits, hyphens and underscores."), code="alias"),
]


# Of deleted accounts: the racer's id follows. Nobody may choose such an alias.
NAMELESS = "deleted-racer-"


class RacerManager(BaseUserManager["Racer"]):
    """Makes racers; e-mail addresses are stored in lower case, so that one address is one account."""

    def create_user(self, alias: str, email: str, password: str | None = None, **fields: Any) -> Racer:
        """A racer who may log in. Without ``password`` the account cannot be logged in to."""
        racer = self.model(alias=alias, email=email.lower(), **fields)
        racer.set_password(password)
        racer.save(using=self._db)
        return racer

    def create_superuser(self, alias: str, email: str, password: str | None = None, **fields: Any) -> Racer:
        return self.create_user(alias, email, password, is_staff=True, is_superuser=True, **fields)

    def get_by_natural_key(self, alias: str | None) -> Racer:
        return self.get(alias__iexact=alias)


class Racer(AbstractBaseUser, PermissionsMixin):
    """A racer. The alias is public; only the owner and admins see the e-mail address.

    House cars belong to racers with ``is_house``, programs have ``is_program`` and tokens, known racers of imported
    seasons have a ``record_id``, guests with real cars a ``guest_name``, deleted accounts an alias that begins with
    :data:`NAMELESS`: none of them can log in.
    """

    alias = models.CharField(_("alias"), max_length=64, unique=True, validators=ALIAS_VALIDATORS)
    email = models.EmailField(_("e-mail address"), unique=True)
    country = models.CharField(_("country"), max_length=2, blank=True, help_text=_("Two-letter code, such as KR."))
    team = OneLineField(_("team"), max_length=64, blank=True)
    record_id = models.CharField(_("id in imported seasons"), max_length=64, unique=True, null=True, editable=False)
    guest_name = OneLineField(
        _("name of the guest"), max_length=64, blank=True, default="", db_default="", editable=False
    )
    avatar = models.CharField(
        _("picture"), max_length=32, unique=True, null=True, editable=False, help_text=_("Empty: the drawn one.")
    )
    avatar_bytes = models.PositiveIntegerField(default=0, db_default=0, editable=False)
    hides_results_since = models.DateTimeField(
        _("hides results since"),
        null=True,
        blank=True,
        editable=False,
        help_text=_(
            "Results of races since then stay hidden until the racer has watched them. Empty: no results are hidden."
        ),
    )
    is_house = models.BooleanField(_("house car"), default=False)
    is_program = models.BooleanField(_("program"), default=False, db_default=False, editable=False)
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
            models.CheckConstraint(
                condition=models.Q(record_id=None)
                | models.Q(is_active=False, is_house=False, is_staff=False) & ~models.Q(record_id=""),
                name="racer_of_a_record_has_no_log_in",
            ),
        ]

    def __str__(self) -> str:
        return self.alias

    def set_unusable_password(self) -> None:
        super().set_unusable_password()
        self._closed = True

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Delete tokens and known addresses when the password changes; a new hash of the same password is no change."""
        chosen = getattr(self, "_password", None) is not None  # Django's own mark of a new password
        changed = not self._state.adding and (chosen or getattr(self, "_closed", False))
        with transaction.atomic():
            super().save(*args, **kwargs)
            if changed:
                self._end_access()
        self._closed = False

    def _end_access(self) -> None:
        """Delete tokens and known addresses. Sessions end by themselves: each is signed with the password's hash."""
        from knox.models import get_token_model  # knox's models need this one

        get_token_model().objects.filter(user=self).delete()
        self.known_addresses.all().delete()

    @property
    def shown_name(self) -> str:
        """The name on pages: of a guest the typed one, of a deleted account a number."""
        if self.alias.startswith(NAMELESS):
            return gettext("Deleted racer %(number)s") % {"number": self.alias.removeprefix(NAMELESS)}
        return self.guest_name or self.alias

    @property
    def has_page(self) -> bool:
        """Whether the racer has a public page: active accounts and racers of imported seasons."""
        return (self.is_active and not self.is_program) or (self.record_id is not None and not self.guest_name)

    def get_absolute_url(self) -> str:
        return reverse("racer", args=[self.alias])


Viewer: TypeAlias = "Racer | AnonymousUser | None"  # None and AnonymousUser: a guest
