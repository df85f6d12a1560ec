"""Who did what, when and why: the admin site's own log, also for what admins do elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.contrib.admin.models import CHANGE, LogEntry
from django.db.models import Model

if TYPE_CHECKING:
    from league.models import Racer


def log(by: Racer, row: Model, action: int, what: str) -> LogEntry:
    """Write one line of the log. ``action``: django.contrib.admin.models ADDITION, CHANGE or DELETION."""
    return LogEntry.objects.log_actions(
        user_id=by.pk, queryset=[row], action_flag=action, change_message=what, single_object=True
    )


def log_if_admin(by: Racer, row: Model, what: str) -> None:
    """Write a line for what an admin did on the site itself; organisers' own races are their own business."""
    if by.is_staff:
        log(by, row, CHANGE, what)
