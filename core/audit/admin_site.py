"""Copies the admin site's own log into the audit log."""

from functools import wraps
from typing import Any

from django.contrib.admin.models import ADDITION, CHANGE, DELETION, LogEntryManager
from django.db import transaction
from django.db.models import Model
from django.utils.translation import gettext_lazy as _

from .acting import ADMIN, acting, current_request
from .acts import AuditAct, register
from .recording import Changes, columns_of, differences, stored, write, written

_ACTS = {
    ADDITION: register(AuditAct("admin.added", _("added in the admin site"))),
    CHANGE: register(AuditAct("admin.changed", _("changed in the admin site"))),
    DELETION: register(AuditAct("admin.deleted", _("deleted in the admin site"))),
}


def copy_admin_log() -> None:
    """From now on, what the admin site logs is also an audit entry. Django writes some of its entries without signals,
    so its manager is wrapped."""
    log_actions: Any = LogEntryManager.log_actions
    if hasattr(log_actions, "copied"):
        return

    @wraps(log_actions)
    def copied(self: Any, user_id: Any, queryset: Any, action_flag: int, change_message: Any = "", **more: Any) -> Any:
        rows = list(queryset)
        with transaction.atomic():
            logged = log_actions(self, user_id, rows, action_flag, change_message, **more)
            _copy(rows, action_flag, change_message)
        return logged

    copied.copied = True  # type: ignore[attr-defined]
    LogEntryManager.log_actions = copied  # type: ignore[method-assign]


def _copy(rows: list[Model], flag: int, message: Any) -> None:
    doer = acting()
    if doer is None or doer.channel != ADMIN:
        return  # pages and the API record what their services do
    for row in rows:
        if not written(row):
            write(_ACTS[flag], doer, row, changes=_changes(row, message) if flag == CHANGE else {})


def _changes(row: Model, message: Any) -> Changes:
    """Values of the columns that the form changed; of rows beside it the names alone."""
    request = current_request.get()
    before = getattr(request, "stored_row", None)
    changes: Changes = {}
    if isinstance(before, type(row)) and before.pk == row.pk:
        changes = differences(columns_of(before), stored(row), row._meta.label_lower)
    for part in message if isinstance(message, list) else ():
        for verb, about in part.items():
            if "name" in about:  # a row of a table below the form
                changes[f"{verb}: {about['name']}"[:100]] = None
    lists = {field.name for field in row._meta.many_to_many}
    form = getattr(request, "changed_names", ())
    return changes | {name: None for name in form if name in lists}
