"""``{% querystring %}`` for pages that guests share, in place of Django's."""

from typing import Any

from django import template
from django.template.defaulttags import querystring as querystring_of

register = template.Library()


@register.simple_tag(takes_context=True)
def querystring(context: template.Context, **changes: Any) -> str:
    """Django's tag; on a page that guests share, the link keeps only parameters that the view has read. A part without
    a request has them as ``query``."""
    query = context["query"] if "query" in context else context["request"].GET
    return querystring_of(context, getattr(query, "read_so_far", query), **changes)
