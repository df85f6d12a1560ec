"""What templates of every room ask about accounts."""

from __future__ import annotations

from django import template
from django.conf import settings

from .. import countries
from ..sign_up import CLOSED

register = template.Library()


@register.simple_tag
def sign_up_offered() -> bool:
    """Whether pages offer to sign up: not where the site takes no new racers. By invitation they do, for the page says
    how to come by one."""
    return settings.SIGN_UP != CLOSED


@register.filter
def amount(number: float) -> str:
    """A number of a quota: whole where it is, else with one digit."""
    return f"{number:.0f}" if number == round(number) else f"{number:.1f}"


@register.filter
def country_name(code: str) -> str:
    """The country's name in the reader's language; the code itself when it is not known."""
    return countries.country_name(code)
