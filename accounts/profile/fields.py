"""Public fields of a racer's profile: the racer's page, the API and the settings form are made from this list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from django import forms
from django.utils.translation import get_language, gettext_lazy
from django.utils.translation import gettext as _
from django_countries import countries

from ..models import Racer, Viewer

if TYPE_CHECKING:
    from rest_framework.serializers import Field


@dataclass(frozen=True)
class ProfileField:
    """A public field. ``name``: in the API, of an editable field also its column. ``text``: a value on the page, "" to
    omit it. ``api``: its serializer field. ``form`` and ``body``: of editable fields, on the settings page and in
    ``PATCH /me/``."""

    name: str
    value: Callable[[Racer, Viewer], Any]
    text: Callable[[Any], str]
    api: Callable[[], Field]
    form: Callable[[], forms.Field] | None = None
    body: Callable[[], Field] | None = None


FIELDS: dict[str, ProfileField] = {}


def api_field(kind: str, *given: Any, **options: Any) -> Field:
    """A serializer field by its class name. Only the API needs Django REST framework, which loads slowly."""
    from rest_framework import serializers

    field: Field = getattr(serializers, kind)(*given, **options)
    return field


def country_choices() -> list[tuple[str, str]]:
    """(code, name) sorted by name in the reader's language."""
    return _country_choices(get_language())


@lru_cache(maxsize=8)
def _country_choices(language: str | None) -> list[tuple[str, str]]:
    return [(code, str(name)) for code, name in countries]


def country_name(code: str) -> str:
    """The country's name in the reader's language; the code itself where there is no such country."""
    return countries.name(code) or code


def register(field: ProfileField) -> ProfileField:
    """Add a field. Raises ValueError for a name that is taken, and where only one of ``form`` and ``body`` is given."""
    if field.name in FIELDS or (field.form is None) != (field.body is None):
        raise ValueError(f"{field.name!r} is the name of another field, or lacks its form or its body")
    FIELDS[field.name] = field
    return field


def editable() -> dict[str, ProfileField]:
    return {name: field for name, field in FIELDS.items() if field.form is not None}


register(
    ProfileField(
        "country",
        lambda racer, viewer: racer.country,
        lambda code: country_name(code) if code else "",
        lambda: api_field("CharField", allow_blank=True, help_text="Two-letter code, or empty."),
        lambda: forms.ChoiceField(
            label=gettext_lazy("Country"),
            required=False,
            help_text=gettext_lazy("Shown beside your alias on boards."),
            choices=lambda: [("", _("not shown")), *country_choices()],
        ),
        lambda: api_field(
            "ChoiceField",
            [("", ""), *country_choices()],
            required=False,
            allow_blank=True,
            help_text="Two-letter code, or empty.",
        ),
    )
)
register(
    ProfileField(
        "team",
        lambda racer, viewer: racer.team,
        lambda name: name,
        lambda: api_field("CharField", allow_blank=True),
    )
)
register(
    ProfileField(
        "is_program",
        lambda racer, viewer: racer.is_program,
        lambda is_program: _("program, does not race") if is_program else "",
        lambda: api_field("BooleanField", help_text="A program's account, which cannot race."),
    )
)
register(
    ProfileField(
        "is_house",
        lambda racer, viewer: racer.is_house,
        lambda is_house: _("house car, not ranked") if is_house else "",
        lambda: api_field("BooleanField", help_text="A car of the site, which is not ranked."),
    )
)
