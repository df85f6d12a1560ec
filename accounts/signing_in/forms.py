"""Forms of log-in, sign-up and forgotten passwords."""

from typing import Any

from allauth.account import forms as allauth_forms
from allauth.account.models import EmailAddress
from django.conf import settings
from django.core.exceptions import ValidationError
from django.forms import BaseForm
from django.utils.translation import gettext_lazy as _

from core.forms import explain
from paddock.errors import UserFault

from ..models import ClassLearner, Racer
from .services import may_use_password, require_welcome_domain


class LoginForm(allauth_forms.LoginForm):
    """Log in with the alias or the e-mail address."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        directory = settings.LDAP
        self.fields["login"].label = (
            _("Alias, e-mail address or name at %(directory)s") % {"directory": directory["label"]}
            if directory
            else _("Alias or e-mail address")
        )
        if "remember" in self.fields:
            self.fields["remember"].label = _("Stay logged in")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)

    def clean(self) -> dict[str, object]:
        """As allauth's; a directory that does not answer is an error of its own."""
        try:
            return super().clean()
        except ValidationError:
            fault = getattr(self.request, "directory_fault", None)
            if fault is None:
                raise
            raise ValidationError(explain(fault), code=fault.code) from None


def describe_sign_up(form: BaseForm) -> None:
    """Label and explain the alias and the e-mail address."""
    alias = form.fields["username"]
    alias.label = _("Alias")
    alias.help_text = _("Your name on every board: 2 to 64 English letters, digits, hyphens and underscores.")
    alias.widget.attrs |= {
        "pattern": "[A-Za-z0-9_\\-]{2,64}",
        "title": _("2 to 64 English letters, digits, hyphens and underscores."),
    }
    form.fields["email"].help_text = _("Seen by you and the admins only.")
    for field in form.fields.values():
        field.widget.attrs.pop("placeholder", None)


class WelcomeDomain(BaseForm):
    """A form that takes an address of the domains of this site only (PADDOCK_SIGN_UP_DOMAINS)."""

    def clean_email(self) -> str:
        try:
            require_welcome_domain(self.cleaned_data["email"])
        except UserFault as fault:
            raise ValidationError(explain(fault), code=fault.code) from None
        return super().clean_email()  # type: ignore[misc]  # of allauth's form beside


class NewAddressForm(WelcomeDomain, allauth_forms.AddEmailForm):
    """allauth's form of another e-mail address."""


class SignUpForm(WelcomeDomain, allauth_forms.SignupForm):
    field_order = ["username", "email", "password1", "password2"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        describe_sign_up(self)


class ResetPasswordForm(allauth_forms.ResetPasswordForm):
    """allauth's form, for an account's own or verified address; a pending change of address opens nothing."""

    def clean_email(self) -> str:
        email = super().clean_email()
        verified = EmailAddress.objects.filter(email=email.lower(), verified=True).values_list("user_id", flat=True)
        theirs = set(verified)
        self.users: list[Racer] = [racer for racer in self.users if racer.email == email.lower() or racer.pk in theirs]
        learners = set(ClassLearner.objects.filter(racer__in=self.users).values_list("racer", flat=True))
        self.users = [racer for racer in self.users if racer.pk not in learners and may_use_password(racer)]
        return email
