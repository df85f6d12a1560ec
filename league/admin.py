"""The admin site of seasons, rounds and divisions."""

from typing import Any

from django.contrib import admin, messages
from django.contrib.admin.models import LogEntry
from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import QuerySet
from django.forms import BaseInlineFormSet, CharField, HiddenInput, ModelForm
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.admin import ComparedChanges, ReadOnly
from core.forms import explain, same_value
from paddock.errors import UserFault
from races.errors import problem

from .models import Membership, Round, Season, StewardDecision
from .models.season import usual_stage
from .seasons.services.seasons import FIXED_ONCE_OFFICIAL, delete_season, edition_of, put_in_division
from .standings.services import give_fields

_OFFICIAL = _("The results of this round are official. Revoke them first, under Rounds.")


class RoundAdminForm(ModelForm):
    """A round; its stage is the usual one of its race's division unless another is chosen."""

    def clean(self) -> dict:
        data = super().clean() or self.cleaned_data
        if data.get("race") is not None and not data.get("stage"):
            data["stage"] = usual_stage(data["race"])
        fixed = ("race", "number", "stage") if self.instance.closed_at is not None else ()
        if any(name in data and not same_value(data[name], getattr(self.instance, name)) for name in fixed):
            raise ValidationError(_OFFICIAL)
        return data


class RoundFormSet(BaseInlineFormSet):
    """Rounds that are written together are held against each other too."""

    def clean(self) -> None:
        seen = set()
        for form in self.forms:
            data = getattr(form, "cleaned_data", {})
            if data.get("DELETE") and form.instance.closed_at is not None:
                raise ValidationError(_OFFICIAL)
            if data.get("race") is None or data.get("DELETE"):
                continue
            place = data.get("number"), data.get("stage")
            if place in seen:
                form.add_error("number", _("This division already has a race in this round of the season."))
            seen.add(place)
        super().clean()


class RoundInline(admin.TabularInline):
    """The races that are the season's rounds. A race is made first, under Races, then named here."""

    model = Round
    form = RoundAdminForm
    formset = RoundFormSet
    extra = 1
    autocomplete_fields = ("race",)
    ordering = ("number", "race__division")


class SeasonAdminForm(ModelForm):
    """A season's settings, held against what stood there when the form was opened."""

    edition = CharField(required=False, widget=HiddenInput)

    class Meta:
        model = Season
        fields = "__all__"

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.instance.pk:
            self.initial["edition"] = edition_of(self.instance)

    def _post_clean(self) -> None:
        super()._post_clean()  # type: ignore[misc]  # Django's own, which its stubs leave out
        if not self.instance.pk:
            return
        # held until the admin site's transaction ends: a second form waits, and sees what the first one changed
        stored = Season.objects.select_for_update().get(pk=self.instance.pk)
        edition = self.cleaned_data.get("edition")
        if edition and edition != edition_of(stored):
            self.add_error(None, problem("season_changed_meanwhile"))


@admin.register(Season)
class SeasonAdmin(ComparedChanges, admin.ModelAdmin):
    """Seasons and their rounds. What official results were worked out from is not changed after the fact."""

    form = SeasonAdminForm
    list_display = ("name", "slug", "starts_on", "ends_on", "round_count")
    list_filter = ("starts_on",)
    search_fields = ("name", "slug")
    date_hierarchy = "starts_on"
    inlines = (RoundInline,)
    actions = None

    def get_readonly_fields(self, request: HttpRequest, obj: Season | None = None) -> tuple[str, ...]:
        official = obj is not None and obj.rounds.filter(closed_at__isnull=False).exists()
        return FIXED_ONCE_OFFICIAL if official else ()

    @admin.display(description=_("races"))
    def round_count(self, season: Season) -> int:
        return season.rounds.count()

    def delete_view(self, request: HttpRequest, object_id: str, extra_context: dict | None = None) -> HttpResponse:
        """Redirect to the site's page of deletion, which shows what can be deleted."""
        season = self.get_object(request, object_id)
        if season is None or not self.has_delete_permission(request, season):
            return super().delete_view(request, object_id, extra_context)
        if request.method != "POST":
            return redirect("season_delete", season.slug)
        try:
            with transaction.atomic():
                self.log_deletions(request, Season.objects.filter(pk=season.pk))
                delete_season(season=season, now=timezone.now())
        except UserFault as fault:
            self.message_user(request, explain(fault), messages.ERROR)
            return redirect("season_delete", season.slug)
        self.message_user(request, _("%(season)s is deleted.") % {"season": season.name})
        return redirect("admin:league_season_changelist")


@admin.register(Membership)
class MembershipAdmin(ComparedChanges, admin.ModelAdmin):
    """Divisions of racers. Racers without a row are in the open division."""

    list_display = ("racer", "division", "season", "since")
    list_filter = ("season", "division", "since")
    list_select_related = ("racer", "season")
    search_fields = ("racer__alias", "season__name")
    autocomplete_fields = ("racer", "season")
    readonly_fields = ("since",)
    actions = None

    def has_delete_permission(self, request: HttpRequest, obj: Membership | None = None) -> bool:
        """Not allowed: a promotion follows from its round. To undo one, put the racer into the open division."""
        return super().has_delete_permission(request, obj) and (obj is None or obj.promoted_in_id is None)

    def get_readonly_fields(self, request: HttpRequest, obj: Membership | None = None) -> tuple[str, ...]:
        return ("since",) if obj is None else ("racer", "season", "since")

    def save_model(self, request: HttpRequest, obj: Membership, form: ModelForm, change: bool) -> None:
        """Save a division: racers who are no longer pros leave the pro races that are not over; both are logged."""
        now = timezone.now()
        with transaction.atomic():
            made = put_in_division(season=obj.season, racer=obj.racer, division=obj.division, now=now)
            obj.pk = made.pk
            give_fields(obj.season, now=now)

    def delete_model(self, request: HttpRequest, obj: Membership) -> None:
        season = obj.season
        with transaction.atomic():
            super().delete_model(request, obj)
            give_fields(season, now=timezone.now())


@admin.register(LogEntry)
class LogAdmin(ReadOnly, admin.ModelAdmin):
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


# these pages register themselves
from . import admin_rounds  # noqa: E402, F401
