"""Serializer fields of several rooms."""

from collections.abc import Callable
from datetime import datetime
from typing import Any

from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers

from core.jobs.models import reason_sentence
from paddock.errors.reasons import REASONS


class ZonedDateTimeField(serializers.DateTimeField):
    """A time with its offset from UTC (RFC 3339); one without an offset is refused with the code ``no_offset``."""

    default_error_messages = {
        "no_offset": _("Add the offset from UTC, for example 2026-11-28T14:32:00Z or 2026-11-28T14:32:00+09:00."),
    }

    def enforce_timezone(self, value: datetime) -> Any:
        if timezone.is_naive(value):
            self.fail("no_offset")
        return super().enforce_timezone(value)


class ChoiceField(serializers.ChoiceField):
    """A choice whose values may come from a function, as in Django's fields."""

    def __init__(self, choices: Any, **options: Any) -> None:
        self.listed = choices if callable(choices) else lambda: choices
        self.read = self.listed()
        super().__init__(self.read, **options)

    def _get_choices(self) -> Any:
        if self.read != (listed := self.listed()):  # a view's serializer lives as long as its process
            self.read = listed
            self._set_choices(listed)
        return super()._get_choices()

    choices = property(_get_choices, serializers.ChoiceField._set_choices)


class ReasonSerializer(serializers.Serializer):
    """Why there is no result."""

    code = serializers.CharField()
    fault = serializers.ChoiceField(["user", "platform"], help_text="platform: it does not count, try again.")
    sentence = serializers.CharField()
    params = serializers.DictField()


class ComputedField(serializers.Field):
    """A read-only value that ``function`` computes from the row, serialized and documented as ``shown_as``."""

    def __init__(self, shown_as: Any, function: Callable[[Any], Any], **options: Any) -> None:
        super().__init__(**{"source": "*", "read_only": True, **options})
        self.shown_as, self.function = shown_as, function
        extend_schema_field(shown_as)(self)  # type: ignore[type-var]

    def to_representation(self, row: Any) -> Any:
        value = self.function(row)
        return None if value is None else self.shown_as.to_representation(value)


class ReasonField(ComputedField):
    """The reason stored in ``{prefix}_code`` and ``{prefix}_params`` of the row; None without one."""

    def __init__(self, prefix: str = "reason", **options: Any) -> None:
        self.prefix = prefix
        super().__init__(ReasonSerializer(allow_null=True), self.reason_of, **options)

    def reason_of(self, row: Any) -> dict[str, object] | None:
        code, params = getattr(row, f"{self.prefix}_code"), getattr(row, f"{self.prefix}_params")
        if not code:
            return None
        return {"code": code, "fault": REASONS[code].fault, "sentence": reason_sentence(code, params), "params": params}
