"""Pages that are the same for every guest are made once and given to all of them."""

from __future__ import annotations

import hashlib
import sqlite3
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from django.conf import settings
from django.db import connection
from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response, patch_vary_headers
from django.utils.http import quote_etag

# What the database does not tell changes too: a race opens, "in 5 minutes" becomes "in 4". So a page lives this long
LIVES_S = 1.0
PAGES = 200  # of one process; the one asked for longest ago makes way
VIEWS = frozenset({"home", "race", "race_rules", "races"})
_MESSAGES = "messages"
# What our pages look at of what htmx sends; nothing else of it changes an answer
_HTMX = ("HTTP_HX_REQUEST", "HTTP_HX_TARGET", "HTTP_HX_BOOSTED", "HTTP_HX_HISTORY_RESTORE_REQUEST")

Answer = Callable[[HttpRequest], HttpResponse]


@dataclass
class _Page:
    """A page as it was made, and when: at which version of the database, at which time of the process's clock."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    version: object = None
    made_at: float = 0.0
    content: bytes = b""
    headers: dict[str, str] = field(default_factory=dict)


class SharedPages:
    """Middleware: a guest's home page, races and boards from memory, while the database is as it was.

    Whoever has a session or a token is no guest and always gets a page of their own. A page is kept only if it was
    made for nobody: answered 200, without a cookie and without a CSRF token. It is given only while nothing at all has
    been committed since it was begun, so nothing that was taken back is shown a moment longer.
    """

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response
        self._pages: OrderedDict[tuple, _Page] = OrderedDict()
        self._lock = threading.Lock()

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not _is_guests(request):
            return self.get_response(request)
        page = self._page(_key(request))
        with page.lock:  # the others wait for the first, who makes it
            version = database_version()
            if page.version != version or time.monotonic() - page.made_at > LIVES_S:
                page.version = None
                response = self._made(request, page, version)
                if response is not None:
                    return response
            content, headers = page.content, dict(page.headers)
        return _given(request, content, headers)

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> None:
        """Django calls it once it knows which view answers."""
        request.shared_view = request.resolver_match.url_name  # type: ignore[attr-defined]

    def _page(self, key: tuple) -> _Page:
        with self._lock:
            page = self._pages.setdefault(key, _Page())
            self._pages.move_to_end(key)
            while len(self._pages) > PAGES:
                self._pages.popitem(last=False)
        return page

    def _made(self, request: HttpRequest, page: _Page, version: object) -> HttpResponse | None:
        """Make the page; the response itself where it must not be kept."""
        made_at = time.monotonic()
        response = self.get_response(request)
        kept = (
            response.status_code == 200
            and not response.streaming
            and not response.cookies
            and "CSRF_COOKIE_NEEDS_UPDATE" not in request.META
            and getattr(request, "shared_view", None) in VIEWS
        )
        if not kept:
            return response
        page.content, page.headers = response.content, dict(response.headers)
        page.version, page.made_at = version, made_at
        return None


def database_version() -> object:
    """What is the same exactly as long as nobody commits anything.

    SQLite counts the commits of all other connections (``data_version``), so one of our own asks that never writes;
    PostgreSQL's snapshot names the transactions that a reader sees.
    """
    if connection.vendor == "sqlite":
        return _sqlite_version(str(connection.settings_dict["NAME"]))
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_current_snapshot()::text")
        return cursor.fetchone()[0]


_watching: dict[str, sqlite3.Connection] = {}
_watch = threading.Lock()


def _sqlite_version(path: str) -> tuple[str, int]:
    with _watch:
        if path not in _watching:
            _watching[path] = sqlite3.connect(f"file:{path}?mode=ro", uri=True, check_same_thread=False, timeout=20)
        return path, _watching[path].execute("PRAGMA data_version").fetchone()[0]


def _is_guests(request: HttpRequest) -> bool:
    if request.method != "GET" or "HTTP_AUTHORIZATION" in request.META:
        return False
    if settings.SESSION_COOKIE_NAME in request.COOKIES or _MESSAGES in request.COOKIES:
        return False
    if request.path != "/" and not request.path.startswith("/races/"):
        return False
    return not connection.in_atomic_block  # what a transaction sees is its own


def _key(request: HttpRequest) -> tuple:
    htmx = tuple(request.META.get(name, "") for name in _HTMX)
    theme = request.COOKIES.get("theme", "")
    language = getattr(request, "LANGUAGE_CODE", "")
    return request.get_full_path(), request.scheme, request.META.get("HTTP_HOST", ""), language, theme, htmx


def _given(request: HttpRequest, content: bytes, headers: dict[str, str]) -> HttpResponse:
    response = HttpResponse(content, headers=headers)
    response["Cache-Control"] = "private, no-cache"
    response["ETag"] = quote_etag(hashlib.sha256(content).hexdigest()[:32])
    patch_vary_headers(response, ("Cookie", "Accept-Language", "HX-Request"))
    return get_conditional_response(request, etag=response["ETag"], response=response)
