"""Admin site log entries for admins' actions outside the admin site."""

from collections.abc import Sequence

from django.contrib.admin.models import CHANGE, LogEntry
from django.db.models import Model

from accounts.models import Racer


def log(by: Racer, row: Model, action: int, what: str) -> LogEntry:
    """Write one line of the log. ``action``: django.contrib.admin.models ADDITION, CHANGE or DELETION."""
    return LogEntry.objects.log_actions(
        user_id=by.pk, queryset=[row], action_flag=action, change_message=what, single_object=True
    )


def log_many(by: Racer, rows: Sequence[Model], what: str) -> None:
    """Write a line of the log for each of these rows, which are of one model, that all say the same."""
    for at in range(0, len(rows), 500):
        LogEntry.objects.log_actions(
            user_id=by.pk, queryset=rows[at : at + 500], action_flag=CHANGE, change_message=what
        )


def log_if_admin(by: Racer, row: Model, what: str) -> None:
    """Write a line for what an admin did on the site itself; organisers' own races are their own business."""
    if by.is_staff:
        log(by, row, CHANGE, what)
