"""Draws and duels: looked at, never edited. Heats are driven, repeated and counted by the platform."""

from django.contrib import admin
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils.translation import gettext_lazy

from core.admin import ReadOnly
from core.times import clock

from ..models import Draw, Duel, DuelCompetitor


@admin.register(Draw)
class DrawAdmin(ReadOnly, admin.ModelAdmin):
    list_display = ("race", "entrants", "drawn_at", "over_at")
    list_filter = (("over_at", admin.EmptyFieldListFilter), "race__duel_format")
    list_select_related = ("race",)
    search_fields = ("race__name", "race__slug")
    date_hierarchy = "drawn_at"


class DuelCompetitorInline(ReadOnly, admin.TabularInline):
    model = DuelCompetitor
    fields = ("grid", "entry", "place", "points", "laps", "time", "forfeited", "retired_code")
    readonly_fields = fields
    ordering = ("grid",)

    @admin.display(description=gettext_lazy("bot time"))
    def time(self, car: DuelCompetitor) -> str:
        return clock(car.time_ms or None)

    def get_queryset(self, request: HttpRequest) -> QuerySet[DuelCompetitor]:
        return super().get_queryset(request).select_related("entry__racer", "entry__race")


@admin.register(Duel)
class DuelAdmin(ReadOnly, admin.ModelAdmin):
    list_display = ("race", "round", "number", "state", "evaluation", "tries", "decided_at")
    list_filter = ("state", "race__duel_format")
    list_select_related = ("race", "evaluation")
    search_fields = ("race__name", "race__slug", "evaluation__public_id", "cars__entry__racer__alias")
    inlines = (DuelCompetitorInline,)
