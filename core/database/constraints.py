"""Validation of all check constraints of a row in one query."""

from collections.abc import Collection
from functools import cache
from typing import Any

from django.core.exceptions import FieldError
from django.db import models, router
from django.db.models import Q


class ChecksTogether:
    """Mixin of models: validates all check constraints in one query, and each alone only if they do not all hold."""

    _meta: Any

    def validate_constraints(self, exclude: Collection[str] | None = None) -> None:
        """As Django's. Raises ValidationError."""
        excluded = set(exclude or ())
        if all(isinstance(one, models.CheckConstraint) for one in self._meta.constraints) and _all_hold(self, excluded):
            return
        super().validate_constraints(exclude=excluded)  # type: ignore[misc]


def _all_hold(row: Any, excluded: set[str]) -> bool:
    """Whether each constraint of which no field is left out holds; False where that cannot be asked in one query."""
    model: Any = type(row)
    asked = [(condition, names) for condition, names in _checks(model) if not names & excluded]
    if not asked:
        return True
    every = row._get_field_expression_map(meta=model._meta, exclude=excluded)
    needed = set().union(*(names for _condition, names in asked))
    try:
        return Q(*(condition for condition, _names in asked)).check(
            {name: every[name] for name in needed}, using=router.db_for_write(model, instance=row)
        )
    except (FieldError, KeyError):
        return False


@cache
def _checks(model: Any) -> list[tuple[Q, frozenset[str]]]:
    """Each check constraint's condition, true where it is unknown as in the database, and the fields it names."""
    return [
        (condition, frozenset(name for name, *_lookups in model._get_expr_references(condition)))
        for one in model._meta.constraints
        if isinstance(one, models.CheckConstraint)
        for condition in [Q(one.condition)]
    ]
