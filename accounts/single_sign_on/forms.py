"""The form of the first log-in by a provider: the racing alias."""

from typing import Any

from allauth.socialaccount.forms import SignupForm
from django.utils.translation import gettext_lazy as _

from ..signing_in.forms import WelcomeDomain, describe_sign_up


class AliasForm(WelcomeDomain, SignupForm):
    """Alias and e-mail address. An address that the provider has verified stays as it is."""

    field_order = ["username", "email"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        describe_sign_up(self)
        email = self.fields["email"]
        email.label = _("E-mail address")
        email.disabled = any(address.verified for address in self.sociallogin.email_addresses)

    def validate_unique_email(self, value: str) -> str:
        """In the words of the other form of sign-up."""
        return super(SignupForm, self).validate_unique_email(value)
