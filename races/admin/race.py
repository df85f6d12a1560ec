"""Scheduling, changing, cancelling and cloning races."""

from collections.abc import Callable
from types import new_class
from typing import Any

from django import forms
from django.contrib import admin, messages
from django.core.exceptions import ValidationError
from django.db.models import Count, OuterRef, QuerySet, Subquery
from django.db.models.functions import Coalesce
from django.http import HttpRequest, HttpResponse, HttpResponseRedirect
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

from core.admin import SharedChoices
from core.forms import explain
from core.times import written
from paddock.errors import PaddockError
from paddock.rules.race import BOX_RULES, LAYOUT, RULES, RUN_RULES

from ..entries.selectors.lists import in_state
from ..entries.services.standings import recompute_race
from ..entries.terms import keep_terms, one_form
from ..errors import problem
from ..models import Entry, Race, RaceKind, RaceState, RaceType, Visibility
from ..models.rules import usual
from ..models.sensors import OFFERABLE
from ..pages import services
from ..pages.services import edition_of, has_submissions
from ..rules.fields import rule_fields
from ..rules.form_fields import BoxesField
from ..rules.layout import check_layout
from ..rules.validation import (
    EDITABLE_FIELDS,
    LAID_OUT_BY,
    PHYSICAL_FIELDS,
    RULE_FIELDS,
    TEXT_FIELDS,
    check_times,
)
from .actions import WithReason

_ELSEWHERE = ("direction", *LAYOUT)
# The rules of a race without a column, which a ModelForm does not include.
_INSIDE = tuple(name for name, rule in RULES.items() if not rule.column)
# The fields of races of real cars; an empty one changes nothing.
_OF_REAL_CARS = ("session_s", "minimum_lap_ms")
_Inside = new_class("Inside", (forms.ModelForm,), exec_body=lambda body: body.update(rule_fields(_INSIDE)))


class RaceAdminForm(_Inside):  # type: ignore[misc, valid-type]
    """A race as admins make and change it, under the same rules as everybody's."""

    sensors = forms.MultipleChoiceField(
        label=gettext_lazy("sensors offered"), choices=[(name, name) for name in OFFERABLE], initial=list(OFFERABLE)
    )

    boxes = BoxesField(label=gettext_lazy("boxes in fixed places"), required=False)
    edition = forms.CharField(required=False, widget=forms.HiddenInput)

    class Meta:
        model = Race
        fields = ("slug", "kind", "organiser", *(name for name in EDITABLE_FIELDS if name not in _INSIDE))

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if "slug" in self.fields:
            self.fields["slug"].required = False
            self.fields["slug"].help_text = _("Empty: made from the name. Cannot be changed later.")
        for name in _OF_REAL_CARS:
            if name in self.fields:
                self.fields[name].required = False
        self.initial |= {name: getattr(self.instance, name) for name in _INSIDE}
        if self.instance.pk:
            self.initial["edition"] = edition_of(self.instance)

    def _post_clean(self) -> None:
        for name in _OF_REAL_CARS:
            if name in self.cleaned_data and self.cleaned_data[name] is None:
                self.cleaned_data[name] = getattr(self.instance, name)
        for name in _INSIDE:
            if self.cleaned_data.get(name) is not None:
                setattr(self.instance, name, self.cleaned_data[name])
        super()._post_clean()
        stored = Race.objects.get(pk=self.instance.pk) if self.instance.pk else None
        edition = self.cleaned_data.get("edition")
        if stored is not None and edition and edition != edition_of(stored):
            self.add_error(None, problem("race_changed_meanwhile"))
            return
        submissions = stored is not None and has_submissions(stored)
        now = timezone.now()
        self._add_errors_of(lambda: check_times(self.instance, now=now, before=stored, submissions=submissions))
        if not LAID_OUT_BY & set(self.errors):
            self._add_errors_of(lambda: check_layout(self.instance))

    def _add_errors_of(self, check: Callable[[], None]) -> None:
        """Run ``check`` and add its errors to their fields."""
        try:
            check()
        except ValidationError as error:
            for field, problems in error.error_dict.items():
                if field not in self.errors:
                    self.add_error(field if field in self.fields else None, problems)


class StateFilter(admin.SimpleListFilter):
    """Races by their current state."""

    title = gettext_lazy("state")
    parameter_name = "state"

    def lookups(self, request: HttpRequest, model_admin: admin.ModelAdmin) -> list[tuple[str, Any]]:
        return RaceState.choices

    def queryset(self, request: HttpRequest, queryset: QuerySet) -> QuerySet:
        state = self.value()
        return queryset.filter(in_state(state, timezone.now())) if state in RaceState.values else queryset


def _value(name: str, form: forms.ModelForm) -> Any:
    """A field's value, the default for an empty rule."""
    value = form.cleaned_data[name]
    return usual(name) if value is None and name in RULES else value


def _section(title: Any, *fields: str, description: Any = "") -> Any:
    return title, {"fields": fields, "description": description}


@admin.register(Race)
class RaceAdmin(WithReason):
    form = RaceAdminForm
    list_display = ("name", "kind", "division", "track", "state", "opens_at", "closes_at", "racers", "organiser")
    list_filter = (
        StateFilter,
        "kind",
        "division",
        "ranking_method",
        "race_type",
        "visibility",
        ("track", SharedChoices),
    )
    list_select_related = ("track", "organiser")
    search_fields = ("name", "slug", "organiser__alias", "track__name")
    date_hierarchy = "opens_at"
    autocomplete_fields = ("track", "organiser", "group")
    raw_id_fields = ("beside",)
    actions = ("cancel", "clone", "new_invitations", "work_out_anew")
    fieldsets = (
        _section(
            None, "name", "slug", "kind", "division", "organiser", "group", "team_entries", "description", "edition"
        ),
        _section(gettext_lazy("Prize and terms"), "prize", "sponsor", "terms"),
        _section(gettext_lazy("Time and place"), "opens_at", "closes_at", "track", "direction"),
        _section(
            gettext_lazy("Ranking"),
            *(name for name in RULES if name not in (*RUN_RULES, *LAYOUT, "sensors")),
            description=gettext_lazy("Fixed, like the next section, after the first submission."),
        ),
        _section(
            gettext_lazy("Rules on the track"),
            *(name for name in RUN_RULES if name in RULES and name not in _ELSEWHERE),
            "sensors",
        ),
        _section(
            gettext_lazy("Object avoidance"),
            *BOX_RULES,
            description=gettext_lazy("Boxes in fixed places, or a number of boxes placed by the seed."),
        ),
        _section(
            gettext_lazy("Head-to-head"),
            *(name for name in LAYOUT if RULES[name].race_types == (RaceType.HEAD_TO_HEAD,)),
        ),
        _section(gettext_lazy("Real cars"), *PHYSICAL_FIELDS, "beside"),
        _section(gettext_lazy("Visibility"), "visibility", "invitation_link"),
        _section(gettext_lazy("State"), "state", "cancel_reason", "board", "created_at"),
    )

    def get_queryset(self, request: HttpRequest) -> QuerySet[Race]:
        entries = Entry.objects.filter(race=OuterRef("pk"), withdrawn_at=None, is_baseline=False).order_by()
        on_board = Subquery(entries.values("race").annotate(count=Count("pk")).values("count"))
        return super().get_queryset(request).annotate(racer_count=Coalesce(on_board, 0))

    def get_readonly_fields(self, request: HttpRequest, obj: Race | None = None) -> tuple[str, ...]:
        shown = ("invitation_link", "state", "cancel_reason", "board", "created_at")
        if obj is None:
            return shown
        fixed = {"slug", "kind", "organiser"}
        state = obj.state_at(timezone.now())
        if state in (RaceState.CLOSED, RaceState.CANCELLED):
            fixed |= set(EDITABLE_FIELDS) - set(TEXT_FIELDS)
        else:
            fixed |= {"opens_at"} if state == RaceState.OPEN else set()
            fixed |= {*RULE_FIELDS, "division"} if has_submissions(obj) else set()
        return (*shown, *sorted(fixed))

    def save_model(self, request: HttpRequest, obj: Race, form: forms.ModelForm, change: bool) -> None:
        now = timezone.now()
        if not change:
            obj.slug = obj.slug or services.free_slug(obj.name)
            obj.created_at = now
            obj.terms = one_form(obj.terms)
            obj.save(force_insert=True)
            keep_terms(obj, now)
            return
        changes = {name: _value(name, form) for name in form.changed_data if name in EDITABLE_FIELDS}
        try:
            services.edit_race(race=obj, now=now, edition=form.cleaned_data.get("edition") or None, **changes)
        except PaddockError as fault:  # a car was submitted, or the race opened, while the form was open
            self.message_user(request, explain(fault), messages.ERROR)
            request.is_refused = True  # type: ignore[attr-defined]

    def response_change(self, request: HttpRequest, obj: Race) -> HttpResponse:
        if getattr(request, "is_refused", False):  # it shows the fault instead of "changed successfully"
            return HttpResponseRedirect(request.get_full_path())
        return super().response_change(request, obj)

    def get_actions(self, request: HttpRequest, *where: Any, **named: Any) -> dict[str, Any]:
        actions = super().get_actions(request, *where, **named)
        actions.pop("delete_selected", None)
        return actions

    def has_delete_permission(self, request: HttpRequest, obj: Race | None = None) -> bool:
        """Only a race without entries; others are cancelled."""
        return super().has_delete_permission(request, obj) and (obj is None or not obj.entries.exists())

    @admin.display(description=gettext_lazy("state"))
    def state(self, race: Race) -> str:
        return str(race.state_at(timezone.now()).label) if race.pk else "-"

    @admin.display(description=gettext_lazy("racers"), ordering="racer_count")
    def racers(self, race: Race) -> int:
        return race.racer_count

    @admin.display(description=gettext_lazy("invitation link"))
    def invitation_link(self, race: Race) -> str:
        if not race.pk or race.visibility != Visibility.INVITATION:
            return "-"
        return reverse("race_invitation", args=[race.invitation])

    @admin.display(description=gettext_lazy("entries"))
    def board(self, race: Race) -> str:
        if not race.pk:
            return "-"
        address = f"{reverse('admin:races_entry_changelist')}?race__id__exact={race.pk}"
        return format_html('<a href="{}">{}</a>', address, _("Entries of this race"))

    @admin.action(description=gettext_lazy("Cancel with a reason"), permissions=["change"])
    def cancel(self, request: HttpRequest, queryset: QuerySet[Race]) -> HttpResponse | None:
        return self.with_reason(
            request,
            queryset,
            lambda race, reason: services.cancel_race(race=race, reason=reason, now=timezone.now()),
            action="cancel",
            title=_("Cancel races"),
            consequence=_(
                "Queued and running cars in these races are stopped. Entries and results stay visible, "
                "and everyone sees the reason. This cannot be undone."
            ),
            note="Cancelled",
            done=lambda count: ngettext("%d race was cancelled.", "%d races were cancelled.", count) % count,
        )

    @admin.action(description=gettext_lazy("Copy to the next month"), permissions=["add"])
    def clone(self, request: HttpRequest, queryset: QuerySet[Race]) -> None:
        def clone_one(race: Race) -> None:
            made = services.clone_race(race=race, now=timezone.now())
            self.log_addition(request, made, f"Cloned from {race.slug}")
            address = reverse("admin:races_race_change", args=[made.pk])
            message = format_html(_('<a href="{}">{}</a> opens at {}.'), address, made, written(made.opens_at))
            self.message_user(request, message)

        self.each(request, queryset, clone_one, "Cloned to the next month")

    @admin.action(description=gettext_lazy("Replace the invitation link"), permissions=["change"])
    def new_invitations(self, request: HttpRequest, queryset: QuerySet[Race]) -> None:
        secret = queryset.filter(visibility=Visibility.INVITATION, kind=RaceKind.COMMUNITY)
        done = self.each(
            request, secret, lambda race: services.reset_invitation(race=race), "Replaced the invitation link"
        )
        self.message_user(request, ngettext("%d link was replaced.", "%d links were replaced.", done) % done)

    @admin.action(description=gettext_lazy("Recalculate the standings"), permissions=["change"])
    def work_out_anew(self, request: HttpRequest, queryset: QuerySet[Race]) -> None:
        self.each(request, queryset, lambda race: recompute_race(race=race), "Worked out the standings anew")
        self.message_user(request, _("The standings were recalculated from the results."))
