"""Who did what, when and why: looked at, never changed."""

from __future__ import annotations

from django.contrib import admin
from django.contrib.admin.models import LogEntry
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

from core.admin import ReadOnly

from .models import StewardDecision


@admin.register(LogEntry)
class LogAdmin(ReadOnly, admin.ModelAdmin):
    """Every action of an admin, here or on the site."""

    list_display = ("action_time", "user", "content_type", "object_repr", "what")
    list_filter = ("action_flag", "content_type", "action_time")
    list_select_related = ("user", "content_type")
    search_fields = ("object_repr", "change_message", "user__alias")
    date_hierarchy = "action_time"
    actions = None

    @admin.display(description=_("action and reason"))
    def what(self, entry: LogEntry) -> str:
        return entry.get_change_message()

    def get_queryset(self, request: HttpRequest) -> QuerySet[LogEntry]:
        return super().get_queryset(request).order_by("-action_time", "-pk")


@admin.register(StewardDecision)
class StewardDecisionAdmin(ReadOnly, admin.ModelAdmin):
    """What stewards decided about rounds. Everybody reads it on the round's race, too."""

    list_display = ("at", "round", "decision", "racer", "reason", "by")
    list_filter = ("decision", "round__season", "at")
    list_select_related = ("round__season", "round__race", "racer", "by")
    search_fields = ("racer__alias", "reason", "round__race__name")
    actions = None
