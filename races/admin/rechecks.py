"""Rechecks: what was driven again, where, and what came out."""

from django.contrib import admin, messages
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils.translation import gettext_lazy, ngettext

from core.admin import ReadOnly
from core.database.clock import database_now

from ..models import Recheck
from ..rechecks.services import examine


@admin.register(Recheck)
class RecheckAdmin(ReadOnly, admin.ModelAdmin):
    """Both hashes, engines, processors and workers of each; an action ends the alarm of a difference."""

    list_display = [
        *("__str__", "evaluation", "state", "same", "elsewhere", "stored_sha256", "measured_sha256", "stored_engine"),
        *("measured_engine", "stored_cpu", "measured_cpu", "stored_worker", "worker", "reason_code", "examined_at"),
    ]
    list_filter = ["same", "state", "elsewhere", "day"]
    search_fields = ["evaluation__public_id"]
    list_select_related = ["evaluation__result"]
    readonly_fields = ["stored_sha256", "stored_engine", "stored_cpu", "stored_worker"]
    date_hierarchy = "day"
    actions = ["examined"]

    @admin.display(description=gettext_lazy("sha-256 of the trace"))
    def stored_sha256(self, recheck: Recheck) -> str:
        return recheck.evaluation.result.trace_sha256

    @admin.display(description=gettext_lazy("engine"))
    def stored_engine(self, recheck: Recheck) -> str:
        return recheck.evaluation.result.engine

    @admin.display(description=gettext_lazy("processor"))
    def stored_cpu(self, recheck: Recheck) -> str:
        return recheck.evaluation.result.cpu_model

    @admin.display(description=gettext_lazy("worker of the run"))
    def stored_worker(self, recheck: Recheck) -> str:
        return recheck.evaluation.worker

    @admin.action(description=gettext_lazy("Mark differences as examined"), permissions=["steward"])
    def examined(self, request: HttpRequest, queryset: QuerySet[Recheck]) -> None:
        rows = list(queryset.filter(same=False, examined_at=None))
        count = examine(rechecks=queryset, now=database_now())
        for row in rows:
            self.log_change(request, row, "examined")
        text = ngettext("%(count)d difference examined.", "%(count)d differences examined.", count)
        self.message_user(request, text % {"count": count}, messages.SUCCESS)
