"""Cards, embedded pages, oEmbed, robots.txt and the site maps. All of them show every reader what a guest may see."""

from __future__ import annotations

from urllib.parse import urlsplit

from csp.decorators import csp_replace
from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse, QueryDict
from django.shortcuts import render
from django.urls import Resolver404, resolve, reverse
from django.utils import timezone, translation
from django.utils.cache import get_conditional_response, patch_vary_headers
from django.utils.html import format_html
from django.utils.http import quote_etag
from django.views.decorators.clickjacking import xframe_options_exempt
from django.views.decorators.http import require_safe

from core.addresses import origin_of
from core.cards.registry import CardKind, ShareCard, card_kinds
from core.streams.shared_pieces import shared_value
from races.entries.selectors.visibility import races_visible_to
from races.spoilers.hidden_addresses import SCOPES
from races.spoilers.selectors import HEADER, PARAMETER, spoilers_of
from races.web.views import too_many

RATES = {"card": "40/m"}  # of cards that have to be drawn
CARD_S = 3600  # how long others keep a card before they ask for it again, which is answered 304 while it is the same
WIDTH, LEAST_WIDTH, LEAST_HEIGHT = 640, 240, 200  # of an embedded page
FRAME = (
    '<iframe src="{}" title="{}" width="{}" height="{}" loading="lazy" style="border:0;max-width:100%" '
    "allowfullscreen></iframe>"
)


@require_safe
def card(request: HttpRequest, language: str, kind: str, shared: str) -> HttpResponse:
    """The card of a page as a PNG image in a language; without results where the reader hides them."""
    if language not in dict(settings.LANGUAGES):
        raise Http404
    # the zone of the site, as readers of a shared picture have none
    with translation.override(language), timezone.override(None):
        shown = _card(request, _kind(kind), shared)
    from core.cards.drawing import drawn_cards, fingerprint  # loads Pillow

    etag = quote_etag(fingerprint(shown))
    response = get_conditional_response(request, etag=etag)
    if response is None:
        if shown not in drawn_cards and (late := too_many(request, "card", RATES)) is not None:
            return late
        response = HttpResponse(drawn_cards.png(shown), content_type="image/png")
    response["ETag"] = etag
    response["Cache-Control"] = f"public, max-age={CARD_S}"
    response["Cross-Origin-Resource-Policy"] = "cross-origin"
    patch_vary_headers(response, ("Cookie", HEADER))
    return response


@xframe_options_exempt
@csp_replace({"frame-ancestors": ["*"]})  # type: ignore[arg-type]  # views with arguments are taken too
@require_safe
def embed(request: HttpRequest, kind: str, shared: str) -> HttpResponse:
    """A page that other sites may frame: a board, a run."""
    found = _kind(kind)
    if found.embedded is None:
        raise Http404
    part = found.embedded(shared, _hides(request, found, shared))
    if part is None:
        raise Http404
    response = render(request, part.template, {**part.context, "address": _absolute(found.address(shared))})
    response["Cross-Origin-Resource-Policy"] = "cross-origin"
    return response


@require_safe
def oembed(request: HttpRequest) -> HttpResponse:
    """The embedded page of an address of this site as oEmbed (oembed.com): ``url``, ``maxwidth``, ``maxheight``."""
    if request.GET.get("format", "json") != "json":
        return HttpResponse("Not implemented: this site answers with JSON.\n", content_type="text/plain", status=501)
    address = request.GET.get("url", "")
    kind, key = _named(request, address)
    if QueryDict(urlsplit(address).query).get(PARAMETER) == "hide":  # shared by somebody who hides results
        query_of_reader = request.GET.copy()
        query_of_reader[PARAMETER] = "hide"
        request.GET = query_of_reader  # type: ignore[assignment]
    hides = _hides(request, kind, key)
    part = None if kind.embedded is None else kind.embedded(key, hides)
    if part is None:
        raise Http404
    shown = _card(request, kind, key)
    query = f"?{PARAMETER}=hide" if hides else ""
    width = _within(request.GET.get("maxwidth", ""), LEAST_WIDTH, WIDTH)
    height = _within(request.GET.get("maxheight", ""), LEAST_HEIGHT, part.height)
    language = translation.get_language()
    framed = _absolute(reverse("embed", args=[kind.name, key])) + query
    found = {
        **{"version": "1.0", "type": "rich", "provider_name": "Paddock", "provider_url": f"{settings.SITE_URL}/"},
        **{"title": shown.title, "width": width, "height": height, "cache_age": CARD_S},
        "html": format_html(FRAME, framed, shown.title, width, height),
        "thumbnail_url": _absolute(reverse("card", args=[language, kind.name, key])) + query,
        **{"thumbnail_width": 1200, "thumbnail_height": 630},
    }
    return JsonResponse(found)


@require_safe
def robots(request: HttpRequest) -> HttpResponse:
    """What crawlers may read: pages of the league, nothing of accounts, and no address that only repeats others."""
    return render(request, "config/sharing/robots.txt", {"site": settings.SITE_URL}, content_type="text/plain")


@require_safe
def sitemaps(request: HttpRequest) -> HttpResponse:
    """The site maps by kind of page, each in parts of bounded size."""
    from .sitemaps import site_maps  # loads a library

    def parts() -> dict[str, object]:
        maps = site_maps().items()
        return {"parts": [(name, number) for name, one in maps for number in one.paginator.page_range]}

    return _map(request, "index", shared_value("site maps", parts))


@require_safe
def sitemap(request: HttpRequest, section: str) -> HttpResponse:
    """The public pages of a kind; ``p``: the part, from 1."""
    from .sitemaps import site_maps

    found, number = site_maps().get(section), request.GET.get("p", "1")
    if found is None or not number.isdecimal() or len(number) > 5:
        raise Http404
    pages = shared_value(("site map", section, number), lambda: found.part(int(number)))
    if pages is None:
        raise Http404
    return _map(request, "pages", {"pages": pages})


def _map(request: HttpRequest, name: str, context: dict[str, object]) -> HttpResponse:
    context = {**context, "site": settings.SITE_URL}
    response = render(request, f"config/sharing/sitemap_{name}.xml", context, content_type="application/xml")
    response["Cache-Control"] = f"public, max-age={CARD_S}"
    response["X-Robots-Tag"] = "noindex"
    return response


def _kind(name: str) -> CardKind:
    found = card_kinds().get(name)
    if found is None:
        raise Http404
    return found


def _card(request: HttpRequest, kind: CardKind, key: str) -> ShareCard:
    hides = _hides(request, kind, key)
    found = shared_value(("card", kind.name, key, hides), lambda: kind.card(key, hides))
    if found is None:
        raise Http404
    return found


def _hides(request: HttpRequest, kind: CardKind, key: str) -> bool:
    """Whether the results of a page are hidden from the reader."""
    spoilers = spoilers_of(request)
    if not kind.results or not spoilers.on or not spoilers.hidden:
        return False
    hidden = spoilers.hidden & set(SCOPES[kind.results](request, {kind.argument.rpartition(".")[2]: key}))
    # nobody learns from a shared picture that there is a race which guests may not see
    return bool(hidden) and races_visible_to(None).filter(pk__in=hidden).exists()


def _named(request: HttpRequest, address: str) -> tuple[CardKind, str]:
    """The page that an absolute address of this site names. Raises Http404."""
    try:
        parts = urlsplit(address)
        origin = f"{parts.scheme}://{parts.netloc}"
        match = resolve(parts.path) if origin in (settings.SITE_URL, origin_of(request)) else None
    except (ValueError, Resolver404):
        match = None
    kind = None if match is None else _kind_at(match.url_name)
    if match is None or kind is None:
        raise Http404
    return kind, str(next(iter(match.kwargs.values())))


def _kind_at(name: str | None) -> CardKind | None:
    return next((kind for kind in card_kinds().values() if name in (kind.page, *kind.also)), None)


def _absolute(path: str) -> str:
    return f"{settings.SITE_URL}{path}"


def _within(text: str, least: int, most: int) -> int:
    return max(least, min(most, int(text))) if text.isdecimal() and len(text) < 6 else most
