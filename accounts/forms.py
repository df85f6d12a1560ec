"""Forms of the accounts: log-in, sign-up, profile, tokens and forgotten passwords."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from allauth.account import forms as allauth_forms
from allauth.account.models import EmailAddress
from django import forms
from django.conf import settings
from django.utils.translation import gettext_lazy as _
from django.utils.translation import ngettext

from .countries import country_choices
from .models import ClassLearner, Racer
from .scopes import LABELS, SCOPES

DAYS = (1, 7, 30, 90, 366)


def _choose(field: forms.Field, choices: Sequence[tuple[object, object]]) -> None:
    """Let a field offer these."""
    assert isinstance(field, forms.ChoiceField)
    field.choices = choices


class LoginForm(allauth_forms.LoginForm):
    """Log in with the alias or the e-mail address."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["login"].label = _("Alias or e-mail address")
        if "remember" in self.fields:
            self.fields["remember"].label = _("Stay logged in")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)


class SignUpForm(allauth_forms.SignupForm):
    """A new racer: alias, e-mail address, password."""

    field_order = ["username", "email", "password1", "password2"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        alias = self.fields["username"]
        alias.label = _("Alias")
        alias.help_text = _(
            "Your name on every board: 2 to 64 letters, digits, hyphens and underscores. It cannot be changed later."
        )
        alias.widget.attrs |= {
            "pattern": "[A-Za-z0-9_\\-]{2,64}",
            "title": _("2 to 64 letters, digits, hyphens and underscores."),
        }
        self.fields["email"].help_text = _("Seen by you and the admins only.")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)


class ProfileForm(forms.ModelForm):
    """What a racer may change about themselves."""

    country = forms.ChoiceField(label=_("Country"), required=False, help_text=_("Shown beside your alias on boards."))

    class Meta:
        model = Racer
        fields = ["country"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        _choose(self.fields["country"], [("", _("not shown")), *country_choices()])


class ResetPasswordForm(allauth_forms.ResetPasswordForm):
    """allauth's, for an address that is the account's own or was verified; one that a racer is only about to change to
    opens nothing."""

    def clean_email(self) -> str:
        email = super().clean_email()
        verified = EmailAddress.objects.filter(email=email.lower(), verified=True).values_list("user_id", flat=True)
        theirs = set(verified)
        self.users: list[Racer] = [racer for racer in self.users if racer.email == email.lower() or racer.pk in theirs]
        learners = set(ClassLearner.objects.filter(racer__in=self.users).values_list("racer", flat=True))
        self.users = [racer for racer in self.users if racer.pk not in learners]
        return email


class TokenForm(forms.Form):
    """A token: what for, and for how long."""

    scopes = forms.MultipleChoiceField(
        label=_("Scopes"), choices=[*LABELS.items()], initial=SCOPES, widget=forms.CheckboxSelectMultiple
    )
    days = forms.TypedChoiceField(label=_("Valid for"), coerce=int)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        days = sorted({*DAYS, settings.TOKEN_DAYS})
        _choose(self.fields["days"], [(day, ngettext("%(n)s day", "%(n)s days", day) % {"n": day}) for day in days])
        self.fields["days"].initial = settings.TOKEN_DAYS
