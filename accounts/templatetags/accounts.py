"""What templates of every room ask about accounts."""

from collections.abc import Mapping

from django import template
from django.conf import settings
from django.urls import reverse
from django.utils.html import format_html
from django.utils.safestring import SafeString

from ..models import Racer
from ..pictures.drawing import CELLS, pattern
from ..profile.fields import country_name
from ..profile.regions import region_name
from ..signing_in.services import CLOSED

register = template.Library()
register.filter(country_name)
register.filter(region_name)


@register.simple_tag
def sign_up_offered() -> bool:
    """Whether pages link to sign-up; with invitations they do, because the page explains how to get one."""
    return settings.SIGN_UP != CLOSED


@register.simple_tag
def sign_up_mode() -> str:
    """PADDOCK_SIGN_UP: open, invitation, sso or closed."""
    return settings.SIGN_UP


@register.simple_tag
def single_sign_on() -> Mapping[str, object]:
    """The provider that log-in pages offer: its ``label`` and the ``id`` of its address; empty where there is none."""
    return settings.OIDC


@register.simple_tag
def connections_offered() -> bool:
    """Whether accounts can be connected to a provider."""
    return bool(settings.OIDC or settings.LDAP)


@register.simple_tag
def password_is_for_few() -> bool:
    """Whether only some racers log in by password, and no directory asks for one."""
    return bool(settings.PASSWORD_RACERS and not settings.LDAP)


@register.filter
def amount(number: float) -> str:
    """A number of a quota: whole where it is, else with one digit."""
    return f"{number:.0f}" if number == round(number) else f"{number:.1f}"


@register.simple_tag
def racer_name(racer: Racer, path: str = "") -> SafeString:
    """A racer's name, linked to their page or to ``path``; not linked where the racer has no page."""
    if not racer.has_page:
        return format_html('<span class="name">{}</span>', racer.shown_name)
    return format_html('<a class="name" href="{}">{}</a>', path or racer.get_absolute_url(), racer.alias)


@register.simple_tag
def avatar(racer: Racer, size: int = 20) -> SafeString:
    """A racer's picture of ``size`` pixels, decorative; no query, and no request when it is drawn."""
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
