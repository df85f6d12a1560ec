"""Forms of the account pages."""

from __future__ import annotations

from allauth.account import forms as allauth_forms
from django import forms
from django.utils.translation import gettext_lazy as _

from accounts.countries import country_choices
from accounts.models import Racer


class LoginForm(allauth_forms.LoginForm):
    """Log in with the alias or the e-mail address."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.fields["login"].label = _("Alias or e-mail address")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)


class SignUpForm(allauth_forms.SignupForm):
    """A new racer: alias, e-mail address, password."""

    field_order = ["username", "email", "password1", "password2"]

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        alias = self.fields["username"]
        alias.label = _("Alias")
        alias.help_text = _(
            "Your name on every board: 2 to 64 letters, digits, hyphens and underscores. It cannot be changed later."
        )
        alias.widget.attrs["pattern"] = "[A-Za-z0-9_\\-]{2,64}"
        self.fields["email"].help_text = _("Seen by you and the admins only.")
        for field in self.fields.values():
            field.widget.attrs.pop("placeholder", None)


class ProfileForm(forms.ModelForm):
    """What a racer may change about themselves."""

    country = forms.ChoiceField(label=_("Country"), required=False, help_text=_("Shown beside your alias on boards."))

    class Meta:
        model = Racer
        fields = ["country", "team"]
        help_texts = {"team": _("As it is to stand in the standings of teams: one spelling makes one team.")}

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.fields["country"].choices = [("", _("not shown")), *country_choices()]
