"""Invitations to sign up in the admin site, and the quotas of a racer on the racer's page there."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from django.conf import settings
from django.contrib import admin
from django.forms import ModelForm
from django.http import HttpRequest
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext_lazy as _

from .models import RacerQuota, SignUpInvitation

A_FORTNIGHT = timedelta(days=14)


class QuotaInline(admin.TabularInline):
    """Limits that hold for this racer in place of the site's."""

    model = RacerQuota
    extra = 0


@admin.register(SignUpInvitation)
class SignUpInvitationAdmin(admin.ModelAdmin):
    """Links to sign up with. One that is used up or over stays here, with who made it; deleting it ends it."""

    list_display = ("__str__", "link", "uses", "used", "expires_at", "made_by", "made_at")
    list_filter = ("made_at", "expires_at")
    search_fields = ("note", "made_by__alias")
    readonly_fields = ("link", "used", "made_by", "made_at")
    fields = ("note", "uses", "expires_at", "link", "used", "made_by", "made_at")
    actions = None

    @admin.display(description=_("link"))
    def link(self, invitation: SignUpInvitation) -> str:
        """The address to hand out; as text, so that it is copied and not followed."""
        if not invitation.pk:
            return "–"
        return format_html("<code>{}{}</code>", settings.SITE_URL, invitation.get_absolute_url())

    def save_model(self, request: HttpRequest, obj: SignUpInvitation, form: ModelForm, change: bool) -> None:
        if not change:
            obj.made_by, obj.made_at = request.user, timezone.now()
        super().save_model(request, obj, form, change)

    def get_changeform_initial_data(self, request: HttpRequest) -> dict[str, Any]:
        return {"expires_at": timezone.now() + A_FORTNIGHT} | super().get_changeform_initial_data(request)
