"""Refusals of the race room, by code: for forms on the field to change, for everybody else as one error."""

from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy

from paddock.errors import Param, UserFault
from paddock.errors.reasons import REASONS


def problem(code: str, **params: Param) -> ValidationError:
    """A reason code as a form error in the reader's language. Raises KeyError for an unknown code."""
    return ValidationError(gettext_lazy(REASONS[code].sentence), code=code, params=params)


class RaceRefused(UserFault):
    """A race that cannot be created or changed so. ``errors``: the ValidationError by field; ``code``: of the first
    problem."""

    def __init__(self, errors: ValidationError) -> None:
        code, params = _first(errors)
        super().__init__(code, **params)
        self.errors = errors

    def __reduce__(self) -> tuple:
        return RaceRefused, (self.errors,)


def _first(errors: ValidationError) -> tuple[str, dict[str, Param]]:
    by_field = errors.error_dict if hasattr(errors, "error_dict") else {"": errors.error_list}
    problems_in_order = [(field, error) for field, problems in by_field.items() for error in problems]
    for _, error in problems_in_order:
        if error.code in REASONS:
            return error.code, dict(error.params or {})
    for field, error in problems_in_order:
        return "race_field", {"field": field, "problem": " ".join(map(str, error.messages))}
    raise ValueError("an empty ValidationError refuses nothing")
