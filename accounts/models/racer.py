"""Racers."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.models import AbstractBaseUser, BaseUserManager, PermissionsMixin
from django.core.validators import RegexValidator
from django.db import models, transaction
from django.db.models.functions import Lower
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.validators import ONE_LINE

ALIAS_PATTERN = r"^[A-Za-z0-9_-]{2,64}$"
ALIAS_VALIDATORS = [
    RegexValidator(ALIAS_PATTERN, _("Use 2 to 64 letters, digits, hyphens and underscores."), code="alias"),
]


class RacerManager(BaseUserManager["Racer"]):
    """Makes racers; e-mail addresses are stored in lower case, so that one address is one account."""

    def create_user(self, alias: str, email: str, password: str | None = None, **fields: Any) -> Racer:
        """A racer who may log in. Without ``password`` the account cannot be logged in to."""
        racer = self.model(alias=alias, email=email.lower(), **fields)
        racer.set_password(password)
        racer.save(using=self._db)
        return racer

    def create_superuser(self, alias: str, email: str, password: str | None = None, **fields: Any) -> Racer:
        """An admin with every permission."""
        return self.create_user(alias, email, password, is_staff=True, is_superuser=True, **fields)

    def get_by_natural_key(self, alias: str | None) -> Racer:
        return self.get(alias__iexact=alias)


class Racer(AbstractBaseUser, PermissionsMixin):
    """Somebody who races. The alias is what everybody sees; the e-mail address is seen by its owner and admins only.

    House cars belong to racers with ``is_house``: they cannot log in and are never ranked. Who is known only from an
    imported season has a ``record_id``, the id in that record; they cannot log in either, nor can stand-ins of guests,
    who race real cars without an account by their ``guest_name`` and have no page.
    """

    alias = models.CharField(_("alias"), max_length=64, unique=True, validators=ALIAS_VALIDATORS)
    email = models.EmailField(_("e-mail address"), unique=True)
    country = models.CharField(_("country"), max_length=2, blank=True, help_text=_("Two-letter code, such as KR."))
    team = models.CharField(_("team"), max_length=64, blank=True, validators=[ONE_LINE])
    record_id = models.CharField(_("id in imported seasons"), max_length=64, unique=True, null=True, editable=False)
    guest_name = models.CharField(
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
        help_text=_("Results of races from then on are hidden from the racer until they watched them. Empty: none."),
    )
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
        """Whichever way a password is changed, what the old one let in ends with it. (One that is only hashed anew, by
        stronger means, is no change.)"""
        chosen = getattr(self, "_password", None) is not None  # Django's own mark of a new password
        changed = not self._state.adding and (chosen or getattr(self, "_closed", False))
        with transaction.atomic():
            super().save(*args, **kwargs)
            if changed:
                from ..services import end_access  # which imports the models

                end_access(racer=self)
        self._closed = False

    @property
    def shown_name(self) -> str:
        """What others read: the alias, of a guest the name that was typed."""
        return self.guest_name or self.alias

    @property
    def has_page(self) -> bool:
        """Whether others may look the racer up: not closed accounts, nor guests. Who is known from a record alone was
        never active and has a page."""
        return self.is_active or (self.record_id is not None and not self.guest_name)

    def get_absolute_url(self) -> str:
        return reverse("racer", args=[self.alias])
