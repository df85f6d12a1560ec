"""Selects have the same HTML as Django's own template gives them."""

from __future__ import annotations

import pytest
from django import forms
from django.forms.renderers import DjangoTemplates
from django.utils.safestring import mark_safe
from django.utils.translation import gettext_lazy

CHOICES = [
    ("", "none"),
    ("a", 'A & "b" <i>'),
    (1, mark_safe("<b>safe</b>")),
    ("Group <1>", [("x'y", gettext_lazy("Country")), (2.5, "two")]),
    (None, "nothing"),
]


class WithAttributes(forms.Select):
    """A select whose options have attributes."""

    def create_option(self, *args, **kwargs):
        option = super().create_option(*args, **kwargs)
        option["attrs"] |= {"data-open": '"<ccw>"', "hidden": True, "lang": False, "data-count": 3}
        return option


@pytest.mark.parametrize("kind", [forms.Select, forms.SelectMultiple, WithAttributes, forms.NullBooleanSelect])
@pytest.mark.parametrize("value", [None, "", "a", 1, "x'y"])
def test_a_select_is_as_django_renders_it(kind: type[forms.Select], value: object) -> None:
    widget = kind(attrs={"id": "one", "required": True})
    if kind is not forms.NullBooleanSelect:
        widget.choices = CHOICES
    shown = [value] if kind is forms.SelectMultiple else value
    django_s = lines(widget.render("field", shown, renderer=DjangoTemplates()))
    assert "<option" in django_s[1]
    assert lines(widget.render("field", shown)) == django_s


def lines(html: str) -> list[str]:
    return [line for line in html.splitlines() if line.strip()]
