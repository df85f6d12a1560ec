"""Entries and submissions: looked at, removed with a reason, run again; never edited."""

from django.contrib import admin
from django.db.models import Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

from accounts.request_racer import racer_of
from core.admin import ReadOnly
from core.times import clock

from ..boards.selectors.board import rank_of
from ..entries.services.entries import remove_entry, restore_entry
from ..entries.services.submissions import repeat_submission
from ..models import Entry, OwnEvaluation, Race, Submission
from .actions import WithReason


class LeftFilter(admin.SimpleListFilter):
    """Entries by whether they are on the board."""

    title = gettext_lazy("on the board")
    parameter_name = "left"

    def lookups(self, request: HttpRequest, model_admin: admin.ModelAdmin) -> list[tuple[str, str]]:
        return [("on", _("on the board")), ("withdrawn", _("withdrawn")), ("removed", _("removed"))]

    def queryset(self, request: HttpRequest, queryset: QuerySet) -> QuerySet:
        conditions = {
            "on": Q(withdrawn_at=None),
            "withdrawn": Q(withdrawn_at__isnull=False, removed_at=None),
            "removed": Q(removed_at__isnull=False),
        }
        wanted = conditions.get(self.value() or "")
        return queryset if wanted is None else queryset.filter(wanted)


@admin.register(Entry)
class EntryAdmin(ReadOnly, WithReason):
    """Entries and their standings. Stewards remove and restore entries; nobody edits a result."""

    list_display = ("race", "racer", "classified", "score", "best_lap", "resets", "submission_count", "left")
    list_filter = ("classified", "is_baseline", LeftFilter, "race__kind", "race__division")
    list_select_related = ("race", "racer")
    search_fields = ("racer__alias", "race__name", "race__slug")
    ordering = ("race", "rank_score", "rank_lap", "resets", "achieved_at", "pk")
    actions = ("remove", "restore")
    exclude = ("rank_score", "rank_lap")
    readonly_fields = ("rank",)

    def lookup_allowed(self, lookup: str, value: str, request: HttpRequest) -> bool:
        return lookup == "race__id__exact" or super().lookup_allowed(lookup, value, request)

    @admin.display(description=gettext_lazy("score"), ordering="rank_score")
    def score(self, entry: Entry) -> str:
        return clock(entry.score_ms)

    @admin.display(description=gettext_lazy("best lap"), ordering="best_lap_ms")
    def best_lap(self, entry: Entry) -> str:
        return clock(entry.best_lap_ms)

    @admin.display(description=gettext_lazy("rank"))
    def rank(self, entry: Entry) -> str:
        return str(rank_of(entry) or "-")

    @admin.display(description=gettext_lazy("has left"))
    def left(self, entry: Entry) -> str:
        if entry.removed_at:
            return _("removed")
        return _("withdrawn") if entry.withdrawn_at else ""

    @admin.action(description=gettext_lazy("Remove from the race with a reason"), permissions=["steward"])
    def remove(self, request: HttpRequest, queryset: QuerySet[Entry]) -> HttpResponse | None:
        return self.with_reason(
            request,
            queryset,
            lambda entry, reason: remove_entry(entry=entry, by=racer_of(request), now=timezone.now(), reason=reason),
            action="remove",
            title=_("Remove racers from races"),
            consequence=_(
                "These racers are removed from the board, their queued and running cars are stopped, and "
                "they cannot enter again. Their runs are kept, and you can restore them."
            ),
            note="Removed",
            done=lambda count: ngettext("%d racer was removed.", "%d racers were removed.", count) % count,
        )

    @admin.action(description=gettext_lazy("Restore to the race"), permissions=["steward"])
    def restore(self, request: HttpRequest, queryset: QuerySet[Entry]) -> None:
        removed = queryset.filter(removed_at__isnull=False)
        done = self.each(request, removed, lambda entry: restore_entry(entry=entry, by=racer_of(request)), "Restored")
        self.message_user(request, ngettext("%d racer was restored.", "%d racers were restored.", done) % done)


@admin.register(Submission)
class SubmissionAdmin(ReadOnly, WithReason):
    list_display = ("race", "racer", "number", "evaluation", "state", "is_void", "refunded", "submitted_at")
    list_filter = ("evaluation__state", "is_void", "refunded", "submitted_at", "entry__race__kind")
    list_select_related = ("entry__race", "entry__racer", "evaluation")
    search_fields = ("entry__racer__alias", "entry__race__name", "evaluation__public_id", "network__sha256")
    date_hierarchy = "submitted_at"
    actions = ("repeat",)

    @admin.display(description=gettext_lazy("race"), ordering="entry__race")
    def race(self, submission: Submission) -> Race:
        return submission.entry.race

    @admin.display(description=gettext_lazy("racer"), ordering="entry__racer__alias")
    def racer(self, submission: Submission) -> str:
        return submission.entry.racer.alias

    @admin.display(description=gettext_lazy("state"), ordering="evaluation__state")
    def state(self, submission: Submission) -> str:
        return submission.evaluation.get_state_display()

    @admin.action(description=gettext_lazy("Run again (failed or stopped runs)"), permissions=["steward"])
    def repeat(self, request: HttpRequest, queryset: QuerySet[Submission]) -> None:
        done = self.each(
            request,
            queryset,
            lambda one: repeat_submission(submission=one, now=timezone.now()),
            "Put into the queue again",
        )
        self.message_user(request, ngettext("%d run queued again.", "%d runs queued again.", done) % done)


@admin.register(OwnEvaluation)
class OwnEvaluationAdmin(ReadOnly, admin.ModelAdmin):
    """Runs requested by racers, and those deleted within a day."""

    list_display = ("owner", "evaluation", "race", "submit_if_better", "submission", "asked_at", "deleted_at")
    list_filter = ("submit_if_better", ("deleted_at", admin.EmptyFieldListFilter))
    list_select_related = ("owner", "evaluation", "race", "submission__entry__racer")
    search_fields = ("owner__alias", "evaluation__public_id", "race__slug")
    date_hierarchy = "asked_at"
