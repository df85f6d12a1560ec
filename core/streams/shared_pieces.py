"""Parts of pages that all readers share, made at most once a second.

A page states up to which event it shows everything (``data-stream-at``), and asks again for what later events change.
So every shared part of a page must be at least as new as that position. Most requests take a position read within the
last second; each part is then made once per position, however many commits and readers there are.
"""

import re
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TypeVar

from django.conf import settings
from django.template.loader import render_to_string
from django.urls import get_script_prefix
from django.utils import timezone
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import get_language

from core.database.commit_cache import Unchanged, is_shared

from .reading import last_numbered

T = TypeVar("T")

# Parts have times such as "in 5 minutes", so they are made anew after this even when nothing was committed
LIVES_S = 1.0
PARTS = 400  # of one process; the one asked for longest ago makes way
LASTING, LASTING_PIECES = 40, 3000  # of those that no commit changes: values of any size, and small HTML


class _Newest:
    """The position of the newest event, read once in ``PADDOCK_SHARED_PAGE_SECONDS``."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._read_at, self._position = -1.0, 0

    def at_least(self, position: int) -> int:
        """The newest position, read again if the last one is old or below ``position``."""
        with self._lock:
            now = time.monotonic()
            if position > self._position or not 0 <= now - self._read_at < settings.SHARED_PAGE_SECONDS:
                self._position, self._read_at = last_numbered(), now
            return self._position


class _Lasting:
    """Values that stay valid, of which the least recently used beyond ``size`` are dropped."""

    def __init__(self, size: int) -> None:
        self._lock = threading.Lock()
        self._size = size
        self._values: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        value = make()
        with self._lock:
            self._values[key] = value
            while len(self._values) > self._size:
                self._values.popitem(last=False)
        return value


_newest = _Newest()
_lasting, _lasting_pieces = _Lasting(LASTING), _Lasting(LASTING_PIECES)
_parts: Unchanged[Any] = Unchanged(PARTS)
# The event that the current request has seen; None: parts are never older than the request
_seen: ContextVar[int | None] = ContextVar("seen", default=None)


@contextmanager
def reading_since(position: int | None) -> Iterator[None]:
    """Let shared parts be as old as event ``position``, or for 0 as the newest event of the last second. None: no part
    is older than the request."""
    token = _seen.set(position)
    try:
        yield
    finally:
        _seen.reset(token)


def shown_position() -> int | None:
    """The event up to which the shared parts of this request show everything; None: all that is committed."""
    seen = _seen.get()
    if seen is None or not (seen or settings.SHARED_PAGE_SECONDS) or not is_shared():
        return None
    newest = _newest.at_least(seen)
    return min(seen, newest) if seen else newest  # a position beyond the newest event is a client's invention


def shared_value(key: Hashable, make: Callable[[], T]) -> T:
    """A value that is the same for every reader of a language. ``make`` must use nothing of a reader or request that is
    not in ``key``, and nobody may change what it returns. A transaction gets a new value."""
    if not is_shared():
        return make()

    def make_whole() -> tuple[T, bool]:
        with reading_since(None):  # it counts as new, so its own parts must be
            return make(), True

    return _parts.get((key, get_language()), LIVES_S, make_whole, number=shown_position(), newest=last_numbered)


def lasting_value(key: Hashable, make: Callable[[], T]) -> T:
    """:func:`shared_value` of what no commit changes: ``key`` names all that it is made of. A transaction gets a new
    value."""
    if not is_shared():
        return make()
    return _lasting.get((key, get_language()), make)


def lasting_piece(template: str, values: Mapping[str, object], *, key: Hashable) -> SafeString:
    """HTML that the values in ``key`` determine, with the language and time zone: drawn without a request, and kept for
    as long as others are not asked for more recently."""
    whole_key = (template, key, get_language(), timezone.get_current_timezone_name(), get_script_prefix())
    return _lasting_pieces.get(whole_key, lambda: render_to_string(template, values))


def shared_piece(template: str, values: Callable[[], Mapping[str, object]], *, key: Hashable) -> SafeString:
    """HTML that is the same for every reader of a language and time zone.

    ``template`` is rendered without a request, so it has no user, session, messages or CSRF token. ``values`` returns
    its context, under the conditions of :func:`shared_value`.
    """
    whole_key = (template, key, timezone.get_current_timezone_name())
    return shared_value(whole_key, lambda: render_to_string(template, values()))


# Random, so that no text of a racer can be taken for a mark. It never leaves the process.
_TOKEN = secrets.token_hex(16)
_MARKED = re.compile(rf"\[{_TOKEN} (\d+)\](.*?)\[/{_TOKEN}\]", re.DOTALL)


@dataclass(frozen=True)
class MarkedPiece:
    """HTML for all readers, and what single readers get within it: by racer the places and texts, in order."""

    html: SafeString
    marks: Mapping[int, list[tuple[int, str]]]

    @classmethod
    def read(cls, drawn: str) -> "MarkedPiece":
        parts: list[str] = []
        marks: dict[int, list[tuple[int, str]]] = {}
        begin = place = 0
        for found in _MARKED.finditer(drawn):
            parts.append(drawn[begin : found.start()])
            place += len(parts[-1])
            begin = found.end()
            marks.setdefault(int(found[1]), []).append((place, found[2]))
        return cls(mark_safe("".join((*parts, drawn[begin:]))), marks)

    def for_reader(self, reader: int | None) -> SafeString:
        if reader is None or reader not in self.marks:
            return self.html
        parts, begin = [], 0
        for place, text in self.marks[reader]:
            parts += [self.html[begin:place], text]
            begin = place
        return mark_safe("".join((*parts, self.html[begin:])))


def hole(name: str) -> SafeString:
    """A place in a piece of :func:`shared_piece` for what is a reader's own, put in by :func:`filled`."""
    return mark_safe(f"[{_TOKEN} {name}]")


def filled(piece: SafeString, **parts: SafeString) -> SafeString:
    """The piece with these parts in its holes of their names."""
    return mark_safe(re.sub(rf"\[{_TOKEN} (\w+)\]", lambda found: parts[found[1]], piece))


def marked(racer: int, html: str) -> str:
    """``html`` within a piece of :func:`marked_piece`, for this racer alone."""
    return f"[{_TOKEN} {racer}]{html}[/{_TOKEN}]"


def marked_piece(
    template: str, values: Callable[[], Mapping[str, object]], *, key: Hashable, reader: int | None
) -> SafeString:
    """:func:`shared_piece` with what ``{% mine racer %}`` (:mod:`core.templatetags.site`) holds for ``reader``: the
    piece is drawn once for all readers, also for those who are named in it."""
    whole_key = (template, key, timezone.get_current_timezone_name())
    piece = shared_value(
        whole_key, lambda: MarkedPiece.read(render_to_string(template, {**values(), "is_marked": True}))
    )
    return piece.for_reader(reader)
