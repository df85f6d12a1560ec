"""Shared parts of this room's admin pages: actions with a reason, read-only rows."""

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


class WithReason(ComparedChanges, ModelAdmin):
    """Actions with a separate page that asks for a reason and lists the consequences."""

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
        """Ask for a reason, then ``call`` every row with it, log it after the ``note``, and report the successes."""
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
        """``call`` every row, log it, and show refusals; returns the number of successes."""
        done = 0
        for row in queryset:
            try:
                call(row)
            except PaddockError as fault:
                self.message_user(request, f"{row}: {explain(fault)}", messages.ERROR)
            else:
                self.log_change(request, row, note)
                done += 1
        return done
