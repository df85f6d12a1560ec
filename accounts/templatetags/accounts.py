"""What templates of every room ask about accounts."""

from __future__ import annotations

from django import template
from django.conf import settings
from django.urls import reverse
from django.utils.html import format_html
from django.utils.safestring import SafeString

from .. import countries, regions
from ..avatars.drawn import CELLS, pattern
from ..models import Racer
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


@register.filter
def region_name(name: str) -> str:
    """A region's name in the reader's language."""
    return regions.region_name(name)


@register.simple_tag
def racer_name(racer: Racer, path: str = "") -> SafeString:
    """What the racer is called, with a link to their page, or to ``path``, a page about them; without one for who has
    none: guests and closed accounts."""
    if not racer.has_page:
        return format_html('<span class="name">{}</span>', racer.shown_name)
    return format_html('<a class="name" href="{}">{}</a>', path or racer.get_absolute_url(), racer.alias)


@register.simple_tag
def avatar(racer: Racer, size: int = 20) -> SafeString:
    """The racer's picture, ``size`` pixels wide, beside their alias, which says whose it is: no query, and no request
    for one that is drawn."""
    if racer.avatar:
        return format_html(
            '<img class="avatar" src="{}" width="{}" height="{}" alt="" loading="lazy" decoding="async">',
            reverse("avatar", args=[racer.avatar]),
            size,
            size,
        )
    colour, path = pattern(racer.pk)
    return format_html(
        '<svg class="avatar avatar-{}" viewBox="-.5 -.5 {} {}" width="{}" height="{}" aria-hidden="true">'
        '<path d="{}"/></svg>',
        colour,
        CELLS + 1,
        CELLS + 1,
        size,
        size,
        path,
    )
