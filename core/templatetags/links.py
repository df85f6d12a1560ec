"""``{% querystring %}`` for pages that guests share, in place of Django's."""

from typing import Any

from django import template
from django.template.defaulttags import querystring as querystring_of
from django.template.loader import render_to_string
from django.utils.safestring import SafeString

from core.streams.shared_pieces import lasting_piece

register = template.Library()
MOST_KEPT = 200  # characters of a query whose links are kept


@register.simple_tag(takes_context=True)
def querystring(context: template.Context, **changes: Any) -> str:
    """Django's tag; on a page that guests share, the link keeps only parameters that the view has read. A part without
    a request has them as ``query``."""
    query = context["query"] if "query" in context else context["request"].GET
    return querystring_of(context, getattr(query, "read_so_far", query), **changes)


@register.simple_tag(takes_context=True)
def pager(context: template.Context, number: int, pages: int) -> SafeString | str:
    """Links to the page before and the page after ``number``; nothing where there is one page."""
    if pages < 2:
        return ""
    others = querystring(context, page=None)
    if len(others) > MOST_KEPT:
        return render_to_string("parts/pages.html", {"number": number, "pages": pages, "others": f"{others}&"})
    values = {"number": number, "pages": pages, "others": f"{others}&" if len(others) > 1 else "?"}
    return lasting_piece("parts/pages.html", values, key=tuple(values.values()))
