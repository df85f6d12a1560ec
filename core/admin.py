"""What admin pages of several rooms share."""

from __future__ import annotations

from typing import Any

from django.db.models import Model
from django.http import HttpRequest


class ReadOnly:
    """Rows that come from racing and are looked at here. Actions ask for the change permission themselves."""

    model: type[Model]  # of the admin page that this is mixed into
    show_full_result_count = False

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_steward_permission(self, request: HttpRequest) -> bool:
        """Whether the admin may act on these rows."""
        return request.user.has_perm(f"{self.model._meta.app_label}.change_{self.model._meta.model_name}")
