"""Tags of a page that other sites read when somebody shares its link: no query, and nothing but what is passed in."""

from django import template
from django.conf import settings
from django.template.loader import render_to_string
from django.urls import reverse
from django.utils.safestring import SafeString
from django.utils.translation import get_language

from core.streams.shared_pieces import lasting_piece

register = template.Library()
_LOCALES = {"en": "en_US", "ko": "ko_KR"}


@register.simple_tag(takes_context=True)
def sharing(
    context: template.Context,
    kind: str,
    key: str,
    page: str,
    title: str,
    description: str = "",
    *,
    hides: bool = False,
    framed: bool = False,
) -> SafeString | str:
    """Open Graph and Twitter tags with the card of a kind (:mod:`core.cards.registry`), and the canonical link.

    On pages of guests alone: only guests read these tags, and what a racer may see is perhaps not for all. ``page``:
    its address, with the query that a shared link keeps. ``hides``: the reader hides its results, so the card shows
    none. ``framed``: other sites may embed the page, so there is the link to its oEmbed.
    """
    if getattr(context.get("user"), "is_authenticated", False):
        return ""
    language = get_language() or settings.LANGUAGE_CODE
    address, _, asked = page.partition("?")
    query = _query(hides)
    return render_to_string(
        "parts/sharing/tags.html",
        {
            "title": title,
            "description": description,
            "canonical": f"{settings.SITE_URL}{address}",
            "address": f"{settings.SITE_URL}{page}{query and (query.replace('?', '&') if asked else query)}",
            "image": f"{settings.SITE_URL}{reverse('card', args=[language, kind, key])}{query}",
            "locale": _LOCALES.get(language, language),
            "oembed": f"{settings.SITE_URL}{reverse('oembed')}" if framed else "",
        },
    )


@register.simple_tag
def share_button(page: str, title: str, *, hides: bool = False) -> SafeString:
    """A button that opens the share sheet of a phone, and elsewhere copies the link."""
    values = {"address": f"{settings.SITE_URL}{page}{_query(hides)}", "title": title}
    return lasting_piece("parts/sharing/button.html", values, key=tuple(values.values()))


def _query(hides: bool) -> str:
    return "?spoilers=hide" if hides else ""
