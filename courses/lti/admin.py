"""The admin pages of learning platforms: a platform is registered here; other rows are read, or unlinked."""

from typing import Any

from django import forms
from django.contrib import admin
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

from core.admin import ComparedChanges, ReadOnly
from core.forms import explain
from paddock.errors import UserFault

from ..models import LtiAccount, LtiContext, LtiPlatform, LtiScore
from ..models.lti import LONGEST_ID
from .asking import refuse_unreachable

ADDRESSES = ("authorize_url", "token_url", "jwks_url")


class PlatformForm(forms.ModelForm):
    """A platform; deployment ids one a line."""

    deployment_lines = forms.CharField(
        label=_("Deployment IDs"), widget=forms.Textarea(attrs={"rows": 3}), help_text=_("One a line.")
    )

    class Meta:
        model = LtiPlatform
        fields = ["name", "issuer", "client_id", *ADDRESSES, "audience", "is_active"]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["deployment_lines"].initial = "\n".join(self.instance.deployments)

    def clean_deployment_lines(self) -> str:
        text: str = self.cleaned_data["deployment_lines"]
        self.instance.deployments = list(dict.fromkeys(line.strip() for line in text.splitlines() if line.strip()))
        if any(len(one) > LONGEST_ID for one in self.instance.deployments):
            raise ValidationError(_("A deployment ID has at most %(limit)s characters.") % {"limit": LONGEST_ID})
        return text

    def clean(self) -> dict[str, object]:
        data = super().clean() or self.cleaned_data
        for name in ADDRESSES:
            try:
                refuse_unreachable(data.get(name, "https://example.org"))
            except UserFault as fault:
                self.add_error(name, explain(fault))
        return data


@admin.register(LtiPlatform)
class LtiPlatformAdmin(ComparedChanges):
    form = PlatformForm
    list_display = ["name", "issuer", "client_id", "is_active", "added_at"]
    fields = ["name", "issuer", "client_id", "deployment_lines", *ADDRESSES, "audience", "is_active"]


class Unlinkable(ReadOnly, ComparedChanges):
    """Rows that launches make, and that an admin may delete."""

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return request.user.has_perm(f"courses.delete_{self.model._meta.model_name}")


@admin.register(LtiContext)
class LtiContextAdmin(Unlinkable):
    list_display = ["title", "platform", "group", "linked_at"]
    list_select_related = ["platform", "group"]
    search_fields = ["title", "context_id", "group__name"]


@admin.register(LtiAccount)
class LtiAccountAdmin(Unlinkable):
    list_display = ["racer", "platform", "context", "linked_at"]
    list_select_related = ["racer", "platform", "context"]
    search_fields = ["racer__alias", "sub"]


@admin.register(LtiScore)
class LtiScoreAdmin(ReadOnly, ComparedChanges):
    list_display = ["line", "racer", "state", "points", "maximum", "reason_code", "attempt", "ended_at"]
    list_filter = ["state", "reason_code"]
    list_select_related = ["line", "racer"]
