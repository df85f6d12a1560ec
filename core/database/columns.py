"""Text columns without invisible characters, and lengths and defaults of columns."""

from collections.abc import Iterable
from typing import Any

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Field, Model

from paddock.errors import UserFault

from ..validators import CODE, normalized, visible_line, without_invisible


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


class TextRefused(UserFault):
    """A text holds an invisible character (:mod:`core.validators`). ``errors``: the ValidationError by field."""

    def __init__(self, name: str, problem: ValidationError) -> None:
        super().__init__(problem.code or CODE, **(problem.params or {}))
        self.errors = ValidationError({name: problem})


class _SeenByOthers:
    """Mixin of text fields: normalizes the text and refuses invisible characters in new values. Migrations know the
    plain field."""

    lines = False
    name: str
    attname: str

    def deconstruct(self) -> tuple[str, str, Any, Any]:
        name, _path, args, kwargs = super().deconstruct()  # type: ignore[misc]
        plain = type(self).__mro__[2]
        return name, f"django.db.models.{plain.__name__}", args, kwargs

    def to_python(self, value: Any) -> Any:
        value = super().to_python(value)  # type: ignore[misc]
        return normalized(value) if isinstance(value, str) else value

    def validate(self, value: Any, model_instance: Any) -> None:
        super().validate(value, model_instance)  # type: ignore[misc]
        if (problem := self._problem(value)) and not self._is_stored(value, model_instance):
            raise problem

    def pre_save(self, model_instance: Any, add: bool) -> Any:
        value = super().pre_save(model_instance, add)  # type: ignore[misc]
        if (problem := self._problem(value)) and (add or not self._is_stored(value, model_instance)):
            raise TextRefused(self.name, problem)
        return value

    def _problem(self, value: Any) -> ValidationError | None:
        try:
            visible_line(value if isinstance(value, str) else "", lines=self.lines)
        except ValidationError as problem:
            return problem
        return None

    def _is_stored(self, value: str, row: Any) -> bool:
        stored = type(row)._base_manager.filter(pk=row.pk).values_list(self.attname, flat=True).first()
        return stored is not None and normalized(stored) == normalized(value)


class OneLineField(_SeenByOthers, models.CharField):
    """A text on one line that others see."""

    def validate(self, value: Any, model_instance: Any) -> None:
        super().validate(value, model_instance)
        if value and not value.strip():
            raise ValidationError(self.error_messages["blank"], code="blank")


class MultiLineField(_SeenByOthers, models.TextField):
    """A text of several lines that others see."""

    lines = True


def copied_values(row: Model, names: Iterable[str]) -> dict[str, Any]:
    """These values of a row, for another one: texts of before without their invisible characters."""
    values = {name: getattr(row, name) for name in names}
    for field in row._meta.concrete_fields:
        if isinstance(field, _SeenByOthers) and values.get(field.name):
            values[field.name] = without_invisible(values[field.name], lines=field.lines)
    return values
