"""Forms of the accounts: which token, and whose password."""

from __future__ import annotations

from allauth.account import forms as allauth_forms
from allauth.account.models import EmailAddress
from django import forms
from django.conf import settings
from django.utils.translation import gettext_lazy as _
from django.utils.translation import ngettext

from .scopes import LABELS, SCOPES

DAYS = (1, 7, 30, 90, 366)


class ResetPasswordForm(allauth_forms.ResetPasswordForm):
    """allauth's, for an address that is the account's own or was verified; one that a racer is only about to change to
    opens nothing."""

    def clean_email(self) -> str:
        email = super().clean_email()
        verified = EmailAddress.objects.filter(email=email.lower(), verified=True).values_list("user_id", flat=True)
        theirs = set(verified)
        self.users = [racer for racer in self.users if racer.email == email.lower() or racer.pk in theirs]
        return email


class TokenForm(forms.Form):
    """A token: what for, and for how long."""

    scopes = forms.MultipleChoiceField(
        label=_("It may"), choices=[*LABELS.items()], initial=SCOPES, widget=forms.CheckboxSelectMultiple
    )
    days = forms.TypedChoiceField(label=_("It holds for"), coerce=int)

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        days = sorted({*DAYS, settings.TOKEN_DAYS})
        self.fields["days"].choices = [(day, ngettext("%(n)s day", "%(n)s days", day) % {"n": day}) for day in days]
        self.fields["days"].initial = settings.TOKEN_DAYS
