"""Shows the list of guides, one guide, and the results of a search."""

from django.http import Http404, HttpRequest, HttpResponse, HttpResponsePermanentRedirect
from django.shortcuts import render
from django.urls import reverse
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from . import pages


@require_safe
def guides(request: HttpRequest) -> HttpResponse:
    asked = " ".join(request.GET.get("q", "").replace("\0", "").split())[: pages.LONGEST_SEARCH]
    found = pages.search(asked, get_language() or "en")
    context = {"guides": pages.GUIDES, "asked": asked, "found": found, "most": pages.MOST_FOUND}
    return render(request, "config/guides/guides.html", context)


@require_safe
def guide(request: HttpRequest, slug: str) -> HttpResponse:
    if slug in pages.MOVED:
        moved_to, _mark, anchor = pages.MOVED[slug].partition("#")
        return HttpResponsePermanentRedirect(f"{reverse('guide', args=[moved_to])}#{anchor}")
    shown = pages.guide_named(slug)
    page = pages.page_of(shown, get_language() or "en") if shown else None
    if shown is None or page is None:
        raise Http404
    contents = [section for section in page.sections if section.level == 2]
    parts = pages.sections_split_from(shown, get_language() or "en")
    context = {"guide": shown, "page": page, "contents": contents, "parts": parts, "guides": pages.GUIDES}
    return render(request, "config/guides/guide.html", context)
