"""What the admin pages of this room share: actions with a reason, rows that are only looked at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from django.contrib import messages
from django.contrib.admin import ModelAdmin, helpers
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render

from core.admin import ComparedChanges
from core.forms import explain
from paddock.errors import PaddockError


def sentence(fault: PaddockError) -> str:
    """The fault in the reader's language."""
    return explain(fault)


class WithReason(ComparedChanges, ModelAdmin):
    """Actions that ask for a reason on a page of their own, which says what will follow."""

    def with_reason(
        self,
        request: HttpRequest,
        queryset: QuerySet,
        call: Callable[[Any, str], object],
        *,
        action: str,
        title: str,
        consequence: str,
        note: str,
        done: Callable[[int], str],
    ) -> HttpResponse | None:
        """The page that asks; once it was answered, ``call`` every row with the reason, log it with the ``note`` before
        the reason, and say in the words of ``done`` how many went through."""
        reason = request.POST.get("reason")
        if reason is not None and reason.strip():
            self.message_user(
                request, done(self.each(request, queryset, lambda row: call(row, reason), f"{note}: {reason}"))
            )
            return None
        context = self.admin_site.each_context(request) | {
            "title": title,
            "action": action,
            "consequence": consequence,
            "rows": queryset,
            "missing": reason is not None,
            "opts": self.model._meta,
            "action_checkbox_name": helpers.ACTION_CHECKBOX_NAME,
        }
        return render(request, "admin/races/reason.html", context, status=200 if reason is None else 422)

    def each(self, request: HttpRequest, queryset: QuerySet, call: Any, note: str) -> int:
        """``call`` every row, log it, and say what was refused; returns how many went through."""
        done = 0
        for row in queryset:
            try:
                call(row)
            except PaddockError as fault:
                self.message_user(request, f"{row}: {sentence(fault)}", messages.ERROR)
            else:
                self.log_change(request, row, note)
                done += 1
        return done


def seconds(time_ms: int | None) -> str:
    """``m:ss.mmm``, or a dash."""
    return "-" if time_ms is None else f"{time_ms // 60_000}:{time_ms // 1000 % 60:02}.{time_ms % 1000:03}"
