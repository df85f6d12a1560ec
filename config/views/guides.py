"""The guides as pages."""

from __future__ import annotations

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from config.guides import GUIDES, LONGEST_SEARCH, MOST_FOUND, guide_named, page_of, search


@require_safe
def guides(request: HttpRequest) -> HttpResponse:
    """All guides, or what they say about something."""
    asked = " ".join(request.GET.get("q", "").replace("\0", "").split())[:LONGEST_SEARCH]
    found = search(asked, get_language() or "en")
    context = {"guides": GUIDES, "asked": asked, "found": found, "most": MOST_FOUND}
    return render(request, "config/guides.html", context)


@require_safe
def guide(request: HttpRequest, slug: str) -> HttpResponse:
    """One guide with its contents beside it."""
    shown = guide_named(slug)
    page = page_of(shown, get_language() or "en") if shown else None
    if shown is None or page is None:
        raise Http404
    contents = [section for section in page.sections if section.level == 2]
    return render(request, "config/guide.html", {"guide": shown, "page": page, "contents": contents, "guides": GUIDES})
