"""Countries a racer may name: ISO 3166 codes with the names that people use, by django-countries."""

from __future__ import annotations

from django_countries import countries


def country_choices() -> list[tuple[str, str]]:
    """(code, name) sorted by name in the reader's language."""
    return [(code, str(name)) for code, name in countries]


def country_name(code: str) -> str:
    """The country's name in the reader's language; the code itself where there is no such country."""
    return countries.name(code) or code
