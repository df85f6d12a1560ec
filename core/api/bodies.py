"""Request bodies that refuse unknown fields: a misspelt one would be ignored and its default stored."""

from collections.abc import Iterable, Mapping
from typing import Any

from drf_spectacular.extensions import OpenApiSerializerExtension
from rest_framework import serializers
from rest_framework.exceptions import ErrorDetail, ValidationError
from rest_framework.request import Request

from core.forms import explain
from paddock.errors import UserFault

# An answer names so many unknown fields at most, each so far: what was sent may be megabytes of them.
MAX_NAMED = 20
MAX_NAME = 64
# Django's own: a page that sends a form with the session's cookie may carry it instead of the header.
NOT_FIELDS = frozenset({"csrfmiddlewaretoken"})


class Body(serializers.Serializer):
    """A serializer that refuses fields it does not have, together with whatever else is wrong; nested ones as well."""

    def to_internal_value(self, data: Any) -> dict[str, object]:
        """As REST framework reads it. Raises ValidationError with the code ``unknown_field`` for each unknown field."""
        known = {name: field for name, field in self.fields.items() if not field.read_only}
        unknown = {
            name: [_detail("unknown_field", field=name, known=", ".join(known))]
            for name in _shown(_unknown(data, known))
        }
        try:
            value = super().to_internal_value(data)
        except ValidationError as refused:
            if unknown and isinstance(refused.detail, dict):
                raise ValidationError({**unknown, **refused.detail}) from None
            raise
        if unknown:
            raise ValidationError(unknown)
        return value


class BodyExtension(OpenApiSerializerExtension):
    """Sets ``additionalProperties: false`` in the schemas of request bodies."""

    target_class = Body
    match_subclasses = True

    def map_serializer(self, auto_schema: Any, direction: str) -> dict[str, object]:
        schema = auto_schema._map_serializer(self.target, direction, bypass_extensions=True)
        return {**schema, "additionalProperties": False} if direction == "request" else schema


def read_as(kind: type[serializers.Serializer], sent: Any, **options: Any) -> dict[str, object]:
    """What was sent as ``kind`` reads it; ``options`` are the serializer's. Raises ValidationError."""
    serializer = kind(data=sent, **options)
    serializer.is_valid(raise_exception=True)
    return serializer.validated_data


def refuse_fields(request: Request) -> None:
    """Refuse any field of an operation without fields. Raises ValidationError with the code ``no_fields``."""
    sent = request.data
    names = _unknown(sent, ()) if isinstance(sent, Mapping) else [""] if sent else []
    if problems := {name: [_detail("no_fields")] for name in _shown(names)}:
        raise ValidationError(problems)


def _unknown(data: Any, known: Iterable[str]) -> list[str]:
    """Names in ``data`` that are not fields; none where it is no mapping at all, which is refused as such."""
    if not isinstance(data, Mapping):
        return []
    return [name for name in data if name not in known and name not in NOT_FIELDS]


def _shown(names: list[str]) -> list[str]:
    return [name[:MAX_NAME].encode("utf-8", "replace").decode() for name in names[:MAX_NAMED]]


def _detail(code: str, **params: str) -> ErrorDetail:
    return ErrorDetail(explain(UserFault(code, **params)), code=code)
