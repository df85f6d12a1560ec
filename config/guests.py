"""Pages that are the same for every guest are made once and given to all of them."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response, patch_vary_headers

from core.streams.reading import last_numbered
from core.unchanged import Unchanged, is_shared
from races.spectators import is_spectator
from races.spoilers import COOKIE, HEADER, PARAMETER

from .moving import ASKS, KNOWS, tag_of
from .reader_zone import zone_of

# What the database does not tell changes too: a race opens, "in 5 minutes" becomes "in 4". So a page lives this long
LIVES_S = 1.0
PAGES = 200  # of one process; the one asked for longest ago makes way
VIEWS = frozenset({"home", "race", "race_duels", "race_rules", "races", "season", "season_standings"}) | frozenset(
    {"live_event", "live_state", "live_poses", "live_frames", "live_ghost", "live_screen", "live_overlay"}
)
_BEGINNINGS = ("/races/", "/seasons/")
_MESSAGES = "messages"
_TAKES_GZIP = re.compile(r"\bgzip\b(?!\s*;\s*q=0(\.0*)?\s*(,|$))")
# What our pages look at of what htmx sends; nothing else of it changes an answer
_HTMX = ("HTTP_HX_REQUEST", "HTTP_HX_TARGET", "HTTP_HX_BOOSTED", "HTTP_HX_HISTORY_RESTORE_REQUEST")

Answer = Callable[[HttpRequest], HttpResponse]


@dataclass
class _Page:
    """A page as it was made. It holds no token and nothing of a reader's, so it may be compressed: that tells nobody
    anything (BREACH)."""

    content: bytes
    headers: dict[str, str]

    @cached_property
    def tag(self) -> str:
        return tag_of(self.content)

    @cached_property
    def small(self) -> bytes:
        return gzip.compress(self.content, compresslevel=5, mtime=0)

    @property
    def small_tag(self) -> str:
        return f'{self.tag[:-1]}-gzip"'


class SharedPages:
    """Middleware: a guest's home page, races and boards from memory, while the database is as it was.

    Whoever has a session or a token is no guest and always gets a page of their own. A page is kept only if it was
    made for nobody: answered 200, without a cookie and without a CSRF token. It is given only to who asked before it
    was begun or while nothing at all has been committed since, so nothing that was taken back is shown a moment longer.

    Pages that were told on the stream what moved say up to which event (:data:`KNOWS`). When hundreds of them ask at
    once, beside workers who commit all the time, they get one that was begun after that event, at most a second old.
    """

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response
        self._pages: Unchanged[_Page | HttpResponse] = Unchanged(PAGES)

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not _is_guests(request):
            return self.get_response(request)
        found = self._pages.get(
            _key(request), LIVES_S, lambda: self._made(request), number=_number(request), newest=last_numbered
        )
        return _given(request, found) if isinstance(found, _Page) else found

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> None:
        """Django calls it once it knows which view answers."""
        match = request.resolver_match
        request.shared_view = match and match.url_name  # type: ignore[attr-defined]

    def _made(self, request: HttpRequest) -> tuple[_Page | HttpResponse, bool]:
        """The page, for all guests; the response itself, for this one, where it must not be kept."""
        response = self.get_response(request)
        for_all = (
            response.status_code == 200
            and not response.streaming
            and not response.cookies
            and "CSRF_COOKIE_NEEDS_UPDATE" not in request.META
            and getattr(request, "shared_view", None) in VIEWS
        )
        return (_Page(response.content, dict(response.headers)), True) if for_all else (response, False)


def _is_guests(request: HttpRequest) -> bool:
    if request.method != "GET" or "HTTP_AUTHORIZATION" in request.META:
        return False
    if any(name in request.COOKIES for name in (settings.SESSION_COOKIE_NAME, _MESSAGES, COOKIE)):
        return False
    if PARAMETER in request.GET or HEADER in request.headers or is_spectator(request):
        return False
    if request.path != "/" and not request.path.startswith(_BEGINNINGS):
        return False
    return is_shared()


def _number(request: HttpRequest) -> int | None:
    told = request.headers.get(KNOWS, "")
    return int(told) if ASKS in request.headers and told.isascii() and told.isdecimal() and len(told) < 19 else None


def _key(request: HttpRequest) -> tuple:
    htmx = tuple(request.META.get(name, "") for name in _HTMX)
    theme, zone = request.COOKIES.get("theme", ""), str(zone_of(request) or "")
    language = getattr(request, "LANGUAGE_CODE", "")
    return request.get_full_path(), request.scheme, request.META.get("HTTP_HOST", ""), language, theme, zone, htmx


def _given(request: HttpRequest, page: _Page) -> HttpResponse:
    small = bool(_TAKES_GZIP.search(request.META.get("HTTP_ACCEPT_ENCODING", "")))
    response = HttpResponse(page.small if small else page.content, headers=page.headers)
    if not response.get("Cache-Control", "").startswith("public"):
        response["Cache-Control"] = "private, no-cache"
    response["ETag"] = page.small_tag if small else page.tag
    if small:
        response["Content-Encoding"] = "gzip"
        response["Content-Length"] = str(len(page.small))
    patch_vary_headers(response, ("Cookie", "Accept-Language", "HX-Request", "Accept-Encoding"))
    return get_conditional_response(request, etag=response["ETag"], response=response) or response
