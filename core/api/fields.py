"""Fields for the bodies of API requests."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from rest_framework import serializers


class ZonedDateTimeField(serializers.DateTimeField):
    """A time with its offset from UTC, as RFC 3339 requires: ``2026-11-28T14:32:00+09:00`` or ``...Z``.

    A time without one would silently mean the site's own time zone, so it is refused with the code ``no_offset``.
    """

    default_error_messages = {
        "no_offset": _("Add the offset from UTC, for example 2026-11-28T14:32:00Z or 2026-11-28T14:32:00+09:00."),
    }

    def enforce_timezone(self, value: datetime) -> Any:
        if timezone.is_naive(value):
            self.fail("no_offset")
        return super().enforce_timezone(value)
