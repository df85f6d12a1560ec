"""The admin pages of models, evaluations, results and workers. What a run measured can be read, never edited."""

from django.contrib import admin, messages
from django.db.models import OuterRef, QuerySet, Subquery
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.utils.translation import ngettext

from core.admin import ReadOnly, SharedChoices, ShortLists
from core.database.clock import database_now
from core.jobs.models import Outage, WorkerHold
from paddock.errors import UserFault

from .garage.services import delete_model, stop_sharing_model
from .models import (
    Evaluation,
    EvaluationRival,
    Network,
    Result,
    RivalResult,
    State,
    StoredFile,
    TrainedModel,
    WorkerNode,
)
from .running.queue.jobs import EVALUATIONS
from .running.queue.services import stop_evaluation
from .running.worker_nodes import RESUME, order_workers


class ReadOnlyAdmin(ReadOnly, ShortLists):
    """Rows that only services write."""


@admin.register(StoredFile)
class StoredFileAdmin(ReadOnlyAdmin):
    """Sums of stored files, and which of them are damaged."""

    list_display = ["name", "size", "damage", "damaged_at", "checked_at"]
    list_filter = ["damage"]
    search_fields = ["name", "sha256"]
    ordering = ["-damage", "name"]

    def get_queryset(self, request: HttpRequest) -> QuerySet[StoredFile]:
        """Without the files of sealed runs: how large a trace is tells how long its car drove."""
        files = super().get_queryset(request)
        for run in Evaluation.with_sealed.filter(sealed=True).values_list("public_id", flat=True):
            files = files.exclude(name__startswith=f"traces/{run}-")
        return files


@admin.register(Network)
class NetworkAdmin(ReadOnlyAdmin):
    list_display = ["sha256", "size", "parameters", "macs", "created_at"]
    search_fields = ["sha256"]
    ordering = ["-created_at"]


@admin.register(TrainedModel)
class TrainedModelAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "name", "owner", "source_kind", "created_at", "shared_at", "deleted_at"]
    list_filter = ["source_kind", ("shared_at", admin.EmptyFieldListFilter), ("deleted_at", admin.EmptyFieldListFilter)]
    search_fields = ["public_id", "name", "owner__alias", "network__sha256", "source_sha256"]
    list_select_related = ["owner"]
    date_hierarchy = "created_at"
    actions = ["stop_sharing", "delete_from_garage"]

    @admin.action(description=_("Stop sharing with other racers"), permissions=["stop"])
    def stop_sharing(self, request: HttpRequest, queryset: QuerySet[TrainedModel]) -> None:
        for model in queryset.exclude(shared_at=None):
            stop_sharing_model(model=model)

    @admin.action(description=_("Delete from the garage (results stay)"), permissions=["stop"])
    def delete_from_garage(self, request: HttpRequest, queryset: QuerySet[TrainedModel]) -> None:
        for model in queryset:
            delete_model(model=model, now=timezone.now())

    def has_stop_permission(self, request: HttpRequest) -> bool:
        return request.user.has_perm("evaluation.delete_trainedmodel")


class ReadOnlyInline(admin.StackedInline):
    """Rows that only services write, on another row's page."""

    can_delete = False
    extra = 0
    has_add_permission = has_change_permission = ReadOnly.has_add_permission


class EvaluationRivalInline(ReadOnlyInline):
    model = EvaluationRival


class ResultInline(ReadOnlyInline):
    model = Result
    show_change_link = True
    exclude = ["trajectory"]


class RivalResultInline(ReadOnlyInline):
    model = RivalResult
    exclude = ["trajectory"]


@admin.register(Result)
class ResultAdmin(ReadOnlyAdmin):
    """Reached from an evaluation: here are the results of the other cars in it."""

    list_display = ["evaluation", "end_reason", "complete_laps", "best_lap_ms", "engine", "created_at"]
    list_filter = ["end_reason", "retired_code", "engine"]
    search_fields = ["evaluation__public_id", "trace_sha256"]
    list_select_related = ["evaluation"]
    exclude = ["trajectory"]
    date_hierarchy = "created_at"
    inlines = [RivalResultInline]


@admin.register(Evaluation)
class EvaluationAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "state", "owner", "model", "track", "attempt", "reason_code", "worker", "queued_at"]
    list_filter = ["state", "reason_code", "worker", ("track", SharedChoices)]
    search_fields = ["public_id", "owner__alias", "model__name", "model__public_id"]
    list_select_related = ["owner", "model", "track"]
    date_hierarchy = "queued_at"
    inlines = [EvaluationRivalInline, ResultInline]
    actions = ["stop", "sweep"]

    def get_queryset(self, request: HttpRequest) -> QuerySet[Evaluation]:
        return super().get_queryset(request).select_related(*self.list_select_related)

    @admin.action(description=_("Stop for good"), permissions=["stop"])
    def stop(self, request: HttpRequest, queryset: QuerySet[Evaluation]) -> None:
        now = timezone.now()
        running = queryset.filter(state__in=[State.QUEUED, State.RUNNING])
        count = sum(stop_evaluation(evaluation=evaluation, now=now) for evaluation in running)
        text = ngettext("%(count)d evaluation was stopped.", "%(count)d evaluations were stopped.", count)
        self.message_user(request, text % {"count": count}, messages.SUCCESS)

    @admin.action(description=_("Sweep the whole queue now"), permissions=["stop"])
    def sweep(self, request: HttpRequest, queryset: QuerySet[Evaluation]) -> None:
        report = EVALUATIONS.sweep(now=database_now())
        text = _("Put back: %(requeued)d, waiting: %(waiting)d.")
        counts = {"requeued": report.requeued, "waiting": report.waiting}
        self.message_user(request, text % counts, messages.SUCCESS)

    def has_stop_permission(self, request: HttpRequest) -> bool:
        return request.user.has_perm("evaluation.change_evaluation")


@admin.register(Outage)
class OutageAdmin(ReadOnlyAdmin):
    list_display = ["part", "since", "looks", "look_at"]


@admin.register(WorkerNode)
class WorkerNodeAdmin(ReadOnlyAdmin):
    list_display = ["name", "seen_at", "held", "engine", "level", "exact"]
    actions = ["pause", "resume", "drain"]

    def get_queryset(self, request: HttpRequest) -> QuerySet[WorkerNode]:
        hold = WorkerHold.objects.filter(worker=OuterRef("name"))
        return super().get_queryset(request).annotate(hold=Subquery(hold.values("mode")))

    @admin.display(description=_("hold"))
    def held(self, node: WorkerNode) -> str:
        hold = getattr(node, "hold", None)
        return str(WorkerHold.Mode(hold).label) if hold else "–"

    @admin.action(description=_("Pause: claim no new jobs"), permissions=["order"])
    def pause(self, request: HttpRequest, queryset: QuerySet[WorkerNode]) -> None:
        self._order(request, queryset, "pause")

    @admin.action(description=_("Resume: claim jobs again"), permissions=["order"])
    def resume(self, request: HttpRequest, queryset: QuerySet[WorkerNode]) -> None:
        self._order(request, queryset, RESUME)

    @admin.action(description=_("Drain: finish the current jobs and exit"), permissions=["order"])
    def drain(self, request: HttpRequest, queryset: QuerySet[WorkerNode]) -> None:
        self._order(request, queryset, "drain")

    def _order(self, request: HttpRequest, queryset: QuerySet[WorkerNode], order: str) -> None:
        names = list(queryset.values_list("name", flat=True))
        try:
            names = order_workers(names=names, order=order, now=database_now())
        except UserFault as fault:
            self.message_user(request, str(fault), messages.ERROR)
            return
        for node in queryset:
            self.log_change(request, node, order)
        self.message_user(request, ", ".join(names), messages.SUCCESS)

    def has_order_permission(self, request: HttpRequest) -> bool:
        return request.user.has_perm("evaluation.change_workernode")

    @admin.display(description=_("sandbox"))
    def level(self, node: WorkerNode) -> str:
        return f"{node.sandbox.get('level')} ({node.sandbox.get('name')})" if node.sandbox else "–"

    @admin.display(description=_("golden runs"))
    def exact(self, node: WorkerNode) -> str:
        return f"{node.proof['equal']}/{node.proof['runs']}" if node.proof else "–"
