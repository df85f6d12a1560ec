"""Which columns may name or belong to a person."""

import re

from django.contrib.auth import get_user_model
from django.db import models

from ..database.columns import MultiLineField, OneLineField

# Texts and files of any author; short texts count by their names.
_KINDS = (
    *(models.EmailField, models.GenericIPAddressField, models.FileField, models.JSONField, models.TextField),
    *(models.BinaryField, OneLineField, MultiLineField),
)
_NAMES = re.compile(
    "(^|_)(about|address|agent|alias|avatar|body|claim|code|country|digest|email|hint|host|ip|key|label|mail|name|note|"
    "object_id|password|path|phone|picture|repr|secret|sha256|team|title|token|url|user|username)($|_)"
)
_HARMLESS = re.compile("^((.+_)?reason_code|retired_code|.*trace_sha256|runs_sha256|source_sha256|sha256|codename)$")


def personal_columns(model: type[models.Model]) -> list[str]:
    """The columns of a model that need a rule: relations to racers, addresses, files, JSON, free and telling texts."""
    columns = [*model._meta.concrete_fields, *model._meta.local_many_to_many]
    return [column.name for column in columns if _is_personal(column)]


def _is_personal(column: models.Field) -> bool:
    if column.is_relation:
        return column.related_model is get_user_model()
    if isinstance(column, _KINDS):
        return True
    is_short_text = isinstance(column, models.CharField) and not column.choices
    return is_short_text and bool(_NAMES.search(column.name)) and not _HARMLESS.match(column.name)
