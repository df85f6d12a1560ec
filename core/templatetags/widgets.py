"""HTML of form widgets that Django renders slowly."""

from collections.abc import Iterable, Mapping
from typing import Any

from django import template
from django.utils.html import conditional_escape
from django.utils.safestring import SafeString, mark_safe

register = template.Library()


@register.filter
def options(groups: Iterable[tuple[str | None, list[dict[str, Any]], int]]) -> SafeString:
    """The options of a select, as Django's ``select_option.html`` writes them: that template is rendered for each one,
    which takes most of the time of a page with 250 countries."""
    html = []
    for name, listed, _index in groups:
        html += [f'\n  <optgroup label="{conditional_escape(name)}">'] if name else []
        html += [
            f'\n  <option value="{conditional_escape(str(each["value"]))}"{_attributes(each["attrs"])}>'
            f"{conditional_escape(each['label'])}</option>"
            for each in listed
        ]
        html += ["\n  </optgroup>"] if name else []
    return mark_safe("".join(html))


def _attributes(attributes: Mapping[str, Any]) -> str:
    return "".join(
        f" {conditional_escape(name)}" + ("" if value is True else f'="{conditional_escape(str(value))}"')
        for name, value in attributes.items()
        if value is not False
    )
