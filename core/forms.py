"""How any form shows what a service refused."""

from __future__ import annotations

from django import forms
from django.utils.translation import gettext, gettext_noop

from paddock.errors import PaddockError

# Details of faults that are words of ours (paddock.geometry.checks); any other text in a detail is somebody's own.
WORDS = frozenset({gettext_noop("centre line"), gettext_noop("inner border"), gettext_noop("outer border")})


def explain(fault: PaddockError) -> str:
    """The fault's sentence in the reader's language, with its details filled in."""
    params = {key: gettext(value) if value in WORDS else value for key, value in fault.params.items()}
    return fault.reason.render(params, gettext(fault.reason.sentence))


def add_fault(form: forms.BaseForm, fault: PaddockError, field: str | None = None) -> None:
    """Show what a service refused: its sentence and its stable code, beside the form or one of its fields."""
    form.add_error(field, forms.ValidationError(explain(fault), code=fault.code))
