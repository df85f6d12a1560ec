"""Forms of log-in, sign-up and forgotten passwords."""

from typing import Any

from allauth.account import forms as allauth_forms
from allauth.account.models import EmailAddress
from django.utils.translation import gettext_lazy as _

from ..models import ClassLearner, Racer


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
    field_order = ["username", "email", "password1", "password2"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        alias = self.fields["username"]
        alias.label = _("Alias")
        alias.help_text = _(
            "Your name on every board: 2 to 64 English letters, digits, hyphens and underscores. "
            "It cannot be changed later."
        )
        alias.widget.attrs |= {
            "pattern": "[A-Za-z0-9_\\-]{2,64}",
            "title": _("2 to 64 English letters, digits, hyphens and underscores."),
        }
        self.fields["email"].help_text = _("Seen by you and the admins only.")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)


class ResetPasswordForm(allauth_forms.ResetPasswordForm):
    """allauth's form, for an account's own or verified address; a pending change of address opens nothing."""

    def clean_email(self) -> str:
        email = super().clean_email()
        verified = EmailAddress.objects.filter(email=email.lower(), verified=True).values_list("user_id", flat=True)
        theirs = set(verified)
        self.users: list[Racer] = [racer for racer in self.users if racer.email == email.lower() or racer.pk in theirs]
        learners = set(ClassLearner.objects.filter(racer__in=self.users).values_list("racer", flat=True))
        self.users = [racer for racer in self.users if racer.pk not in learners]
        return email
