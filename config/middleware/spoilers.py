"""Replaces pages whose results are hidden from the reader by a page that offers to show them."""

from typing import Any

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils.deprecation import MiddlewareMixin
from django.utils.feedgenerator import Atom1Feed
from django.utils.translation import gettext as _

from core.forms import explain
from races.entries.selectors.visibility import races_visible_to
from races.models import Race
from races.pages.badge import badge
from races.spoilers.hidden_addresses import SCOPES
from races.spoilers.selectors import HIDDEN, asks_to_hide, spoilers_of
from races.web.names import named

SHOWN = 12
_FILES = ("csv", "pdf", "zip", "mp4", "jpg", "png")


class NoSpoilers(MiddlewareMixin):
    """Middleware. Programs that hide spoilers get the error ``results_hidden``."""

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> HttpResponse | None:
        name = (request.resolver_match and request.resolver_match.url_name) or ""
        scope = SCOPES.get(name) if request.method in ("GET", "HEAD") else None
        if scope is None or (name.startswith("api-") and not asks_to_hide(request)):
            return None
        spoilers = spoilers_of(request)
        if not spoilers.on or not spoilers.hidden:
            return None
        hidden = spoilers.hidden & set(scope(request, kwargs))
        # what the reader may not see is not named to them: the page itself answers that it is not there
        races = list(races_visible_to(request.user).filter(pk__in=hidden).order_by("name", "pk")[:SHOWN])
        if not races:
            return None
        response = _instead(request, name, races, more=len(hidden) > len(races))
        response["Cache-Control"] = "private, no-store"
        return response


def _instead(request: HttpRequest, name: str, races: list[Race], *, more: bool) -> HttpResponse:
    ending = request.path.rpartition(".")[2]
    if name.startswith("api-") or ending == "json":
        return JsonResponse({"code": HIDDEN.code, "detail": explain(HIDDEN)}, status=HIDDEN.reason.status)
    if request.headers.get("HX-Request"):
        return HttpResponse(status=204)
    if ending == "svg":
        return HttpResponse(badge(named(races[0].name), _("hidden"), good=False), content_type="image/svg+xml")
    if ending == "atom":
        return _empty_feed(request)
    if ending in _FILES:
        return HttpResponse(f"{explain(HIDDEN)}\n", content_type="text/plain", status=403)
    return render(request, "races/spoilers/hidden.html", {"races": races, "more": more})


def _empty_feed(request: HttpRequest) -> HttpResponse:
    address = request.build_absolute_uri(request.path)
    feed = Atom1Feed(title=_("Results are hidden"), link=address, description="", feed_guid=address)
    return HttpResponse(feed.writeString("utf-8"), content_type=feed.content_type)
