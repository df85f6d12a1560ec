"""Renders pages that are the same for every guest once and shares them.

An answer is shared only if it depends on nothing of the request outside the key: the headers and cookies that the view
reads are recorded (:mod:`config.middleware.request_reads`). Its own Cache-Control is passed on unchanged.
"""

import gzip
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.http.request import HttpHeaders
from django.urls import Resolver404, resolve
from django.utils.cache import get_conditional_response, patch_vary_headers

from core.database.commit_cache import Unchanged, is_shared
from core.streams.reading import last_numbered
from core.streams.shared_pieces import LIVES_S, reading_since, shown_position
from races.spoilers.selectors import COOKIE, HEADER, PARAMETER
from races.web.spectator_links import COOKIE as SPECTATOR_COOKIE
from races.web.spectator_links import HEADER as SPECTATOR_HEADER
from races.web.spectator_links import is_spectator

from .page_etags import tag_of
from .request_reads import EVERYTHING, WHOLE_QUERY, query_names, record_reads, values_of
from .time_zone import zone_of

PAGES = 200  # of one process; the one asked for longest ago makes way
VIEWS = frozenset({"home", "race", "race_duels", "race_rules", "races", "season", "season_standings"}) | frozenset(
    {"live_event", "live_state", "live_poses", "live_frames", "live_ghost", "live_screen", "live_overlay"}
    | {"tracks", "tracks_to_choose", "track_print", "season_calendar", "race_laps", "live_phone"}
    | {"evaluation", "evaluation_live", "replay"}
    | {"api-docs", "status"}
)
_MESSAGES = "messages"
_TAKES_GZIP = re.compile(r"\bgzip\b(?!\s*;\s*q=0(\.0*)?\s*(,|$))")
# What our pages look at of what htmx sends; nothing else of it changes an answer
_HTMX = ("HTTP_HX_REQUEST", "HTTP_HX_TARGET", "HTTP_HX_BOOSTED", "HTTP_HX_HISTORY_RESTORE_REQUEST")
# Headers in the key of a page
_KEYED = ("HTTP_HOST", "HTTP_X_FORWARDED_PROTO", *_HTMX)
# What a view may read of a request and still be shared: the key, the request line, and what no guest's request has
_SAME_FOR_ALL = frozenset(
    {
        *_KEYED,
        *("REQUEST_METHOD", "PATH_INFO", "SCRIPT_NAME", "QUERY_STRING", "wsgi.url_scheme"),
        *("SERVER_NAME", "SERVER_PORT", "CSRF_COOKIE_NEEDS_UPDATE", "HTTP_AUTHORIZATION"),
        *(HttpHeaders.to_wsgi_name(name) for name in (HEADER, SPECTATOR_HEADER)),
        *(f"cookie:{name}" for name in ("theme", settings.SESSION_COOKIE_NAME, _MESSAGES, COOKIE, SPECTATOR_COOKIE)),
    }
)
_VARIED = _SAME_FOR_ALL | {"HTTP_COOKIE", "HTTP_ACCEPT_LANGUAGE", "HTTP_ACCEPT_ENCODING"}

Answer = Callable[[HttpRequest], HttpResponse]


@dataclass
class _Page:
    """A page without tokens or anything of a reader's, so that it may be compressed (BREACH)."""

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

    A request with a session or a token always gets a separate page. A page is stored only if it is anonymous: 200,
    without cookie and CSRF token, by a view that read nothing of the request outside the key (which has only the query
    parameters that the view is known to read). Each page is made once a second at most, except for readers who have
    just changed something (:class:`~config.middleware.fresh_reads.FreshReads`).
    """

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response
        self._pages: Unchanged[_Page | HttpResponse] = Unchanged(PAGES, "pages")
        self._parameters: dict[str, frozenset[str]] = {}  # by view: what it has read of queries in this process

    def __call__(self, request: HttpRequest) -> HttpResponse:
        view = _shared_view(request) if _is_guests(request) else None
        if view is None:
            return self.get_response(request)
        names = self._parameters.get(view, frozenset())
        found = self._pages.get(
            _key(request, names),
            LIVES_S,
            lambda: self._made(request, view, names),
            number=shown_position(),
            newest=last_numbered,
        )
        return _given(request, found) if isinstance(found, _Page) else found

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> None:
        if hasattr(request, "view_reads"):
            request.view_reads = record_reads(request)

    def process_exception(self, request: HttpRequest, exception: Exception) -> None:
        """The page of a fault is not shared: its links lead to the whole address."""
        request.__dict__.pop("get_full_path", None)

    def _made(self, request: HttpRequest, view: str, names: frozenset[str]) -> tuple[_Page | HttpResponse, bool]:
        """The page, and whether the key with the parameters ``names`` has all that it depends on; the response itself
        where it is not for all guests."""
        request.view_reads = {EVERYTHING}  # type: ignore[attr-defined]
        with reading_since(None):  # it counts as new, so its parts must be
            response = self.get_response(request)
        reads: set[str] = request.view_reads  # type: ignore[attr-defined]
        for_all = (
            response.status_code == 200
            and not response.streaming
            and not response.cookies
            and "CSRF_COOKIE_NEEDS_UPDATE" not in request.META
            and not request.session.modified
            and reads - {f"query:{name}" for name in query_names(reads)} <= _SAME_FOR_ALL
            and {HttpHeaders.to_wsgi_name(name) for name in _varies_on(response)} <= _VARIED
        )
        if not for_all:
            return response, False
        read = query_names(reads) | ({WHOLE_QUERY} & reads)
        self._parameters[view] = self._parameters.get(view, frozenset()) | read
        return _Page(response.content, dict(response.headers)), read <= names


def _varies_on(response: HttpResponse) -> list[str]:
    return [name.strip() for name in response.get("Vary", "").split(",") if name.strip()]


def _is_guests(request: HttpRequest) -> bool:
    if request.method != "GET" or "HTTP_AUTHORIZATION" in request.META:
        return False
    if any(name in request.COOKIES for name in (settings.SESSION_COOKIE_NAME, _MESSAGES, COOKIE)):
        return False
    if PARAMETER in request.GET or HEADER in request.headers or is_spectator(request):
        return False
    return is_shared()


def _shared_view(request: HttpRequest) -> str | None:
    try:
        request.resolver_match = resolve(request.path_info)
    except Resolver404:
        return None
    name = request.resolver_match.url_name
    return name if name in VIEWS else None


def _key(request: HttpRequest, names: frozenset[str]) -> tuple:
    headers = tuple(request.META.get(name, "") for name in _KEYED)
    theme, zone = request.COOKIES.get("theme", ""), str(zone_of(request) or "")
    language = getattr(request, "LANGUAGE_CODE", "")
    if WHOLE_QUERY in names:
        query: object = request.META.get(WHOLE_QUERY, "")
    else:
        query = tuple((name, tuple(values)) for name, values in values_of(request.GET, names))
    return request.path, query, request.scheme, language, theme, zone, headers


def _given(request: HttpRequest, page: _Page) -> HttpResponse:
    small = bool(_TAKES_GZIP.search(request.META.get("HTTP_ACCEPT_ENCODING", "")))
    response = HttpResponse(page.small if small else page.content, headers=page.headers)
    response.headers.setdefault("Cache-Control", "private, no-cache")  # a view's own is passed on unchanged
    response["ETag"] = page.small_tag if small else page.tag
    if small:
        response["Content-Encoding"] = "gzip"
        response["Content-Length"] = str(len(page.small))
    patch_vary_headers(response, ("Cookie", "Accept-Language", "HX-Request", "Accept-Encoding"))
    return get_conditional_response(request, etag=response["ETag"], response=response) or response
