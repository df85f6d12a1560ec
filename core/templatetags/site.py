"""The frame of every page: its theme, the navigation, and slots that rooms above fill."""

from __future__ import annotations

from typing import Any

from django import template
from django.conf import settings
from django.db import Error
from django.http import HttpRequest
from django.template import Context
from django.template.base import FilterExpression, Parser, Token, token_kwargs
from django.urls import reverse
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _

from core import mail, pages
from core.events.models import EventCursor

register = template.Library()


@register.simple_tag
def mail_is_sent() -> bool:
    """See :func:`core.mail.mail_is_sent`."""
    return mail.mail_is_sent()


THEMES = ("dark", "light")


@register.filter
def theme(request: HttpRequest | str) -> str:
    """The theme that the reader chose: ``dark``, ``light``, or ``""`` to follow the system."""
    chosen = getattr(request, "COOKIES", {}).get("theme", "")
    return chosen if chosen in THEMES else ""


@register.simple_tag(takes_context=True)
def navigation(context: Context) -> list[dict[str, Any]]:
    """The sections of the site in their order: ``address``, ``label``, and whether the page belongs to it."""
    here = pages.section_of(getattr(context.get("request"), "path", ""))
    return [{"address": reverse(s.page), "label": s.label, "is_here": s.name == here} for s in pages.sections()]


@register.simple_tag
def operators_links() -> list[tuple[str, str]]:
    """(label, address) of each page of the operator's own that the settings name."""
    labels = {"chat": _("Chat"), "tips": _("Tips"), "forum": _("Forum")}
    labels |= {"terms": _("Terms of use"), "privacy": _("Privacy")}
    return [(labels[name], address) for name, address in settings.FOOT_LINKS.items() if address]


@register.simple_tag
def stream_position() -> str:
    """Up to which event a page that is made now shows everything; ``""`` where that cannot be read."""
    cursor = EventCursor.objects.filter(pk=EventCursor.NUMBERED).values_list("position", flat=True)
    try:
        return str(cursor.first() or 0)
    except Error:  # a page that says so is made all the same
        return ""


@register.simple_tag
def section_address(name: str) -> str:
    """Where a section of the site begins; ``""`` where the site has none of this name."""
    return next((reverse(section.page) for section in pages.sections() if section.name == name), "")


class _Slot(template.Node):
    def __init__(self, name: str, values: dict[str, FilterExpression]) -> None:
        self.name, self.values = name, values

    def render(self, context: Context) -> SafeString:
        assert context.template is not None  # it is set as long as a template is rendered
        engine = context.template.engine
        with context.push(**{name: value.resolve(context) for name, value in self.values.items()}):
            return SafeString("".join(engine.get_template(each).render(context) for each in pages.filling(self.name)))


@register.tag
def slot(parser: Parser, token: Token) -> _Slot:
    """``{% slot "race.side" %}``: what rooms above show here. They see the page's context and the values that are named
    after the slot: ``{% slot "garage.tabs" here="models" %}``."""
    words = token.split_contents()
    if len(words) < 2 or words[1][0] not in "\"'":
        raise template.TemplateSyntaxError(f"{words[0]} takes the name of a slot, quoted")
    rest = words[2:]
    values = token_kwargs(rest, parser)
    if rest:
        raise template.TemplateSyntaxError(f"{words[0]} takes values by name, and {rest[0]!r} has none")
    return _Slot(words[1][1:-1], values)
