"""What the database's columns hold."""

from __future__ import annotations

from typing import Any

from django.db.models import Field, Model


def length_of(model: type[Model], name: str) -> int:
    """How many characters a column of text takes. Raises ValueError for a column that has no limit."""
    field = model._meta.get_field(name)
    if not isinstance(field, Field) or field.max_length is None:
        raise ValueError(f"{name} takes any number of characters")
    return field.max_length


def default_of(model: type[Model], name: str) -> Any:
    """What a column holds of a new row. Raises ValueError for an unknown column."""
    field = model._meta.get_field(name)
    if not isinstance(field, Field):
        raise ValueError(f"{name} is no column")
    return field.get_default()
