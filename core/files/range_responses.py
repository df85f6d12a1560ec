"""A stored file as a response that supports byte ranges (RFC 9110, section 14)."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from django.core.files.storage import Storage
from django.db.models.fields.files import FieldFile
from django.http import HttpRequest, HttpResponse, HttpResponseBase, StreamingHttpResponse
from django.utils.cache import get_conditional_response
from django.utils.http import quote_etag

PIECE = 1 << 16
_ONE_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


class Span(NamedTuple):
    """Bytes ``start`` up to, and without, ``stop``. ``is_part``: they were asked for as a range."""

    start: int
    stop: int
    is_part: bool = True


def stored_file_response(
    request: HttpRequest, file: FieldFile, *, size: int, digest: str, content_type: str, most: int | None = None
) -> HttpResponseBase:
    """The stored file, or the part that ``Range`` names, streamed from the storage: 200, 206, 304, 412 or 416.

    ``digest`` becomes the ETag. Several ranges are answered with the whole file. ``most``: the most bytes for a range
    without an end, so that a slow player does not keep a thread of the site. Raises FileNotFoundError before anything
    is sent, and OSError."""
    etag = quote_etag(digest)
    response: HttpResponseBase | None = get_conditional_response(request, etag=etag)
    if response is None:
        span = _asked(request, size, etag, most or size)
        if span is None:
            response = HttpResponse(status=416)
            response["Content-Range"] = f"bytes */{size}"
        else:
            response = _answer(request, file, size, span, content_type)
    response["ETag"] = etag
    response["Accept-Ranges"] = "bytes"
    return response


class _Stored(StreamingHttpResponse):
    """Pieces of a file; the web server sends a local file itself, without one of the site's threads."""

    block_size = PIECE

    def __init__(self, pieces: Iterator[bytes], opened: Any, **kwargs: Any) -> None:
        self.file_to_stream = None if opened is None else _Handed(opened)
        super().__init__(pieces, **kwargs)
        self._opened = opened

    def close(self) -> None:
        if self._opened is not None:
            self._opened.close()
        super().close()


class _Handed:
    """A file as a web server wants one; Django puts the answer's ``close`` in the place of ours."""

    def __init__(self, opened: Any) -> None:
        self.read, self.seek, self.tell, self.close = opened.read, opened.seek, opened.tell, opened.close


def _answer(request: HttpRequest, file: FieldFile, size: int, span: Span, content_type: str) -> HttpResponseBase:
    if not file.name:
        raise FileNotFoundError("no file was stored")
    response: HttpResponseBase
    if request.method == "HEAD":
        if not file.storage.exists(file.name):
            raise FileNotFoundError(file.name)
        response = HttpResponse(content_type=content_type)
    else:
        pieces, opened = _pieces(file.storage, file.name, span)
        response = _Stored(pieces, opened, status=206 if span.is_part else 200, content_type=content_type)
        if span.is_part:
            response["Content-Range"] = f"bytes {span.start}-{span.stop - 1}/{size}"
    response["Content-Length"] = str(span.stop - span.start)
    return response


def _asked(request: HttpRequest, size: int, etag: str, most: int) -> Span | None:
    """What is to be sent; None for a range that begins behind the end, or is of no bytes."""
    whole = Span(0, size, is_part=False)
    found = _ONE_RANGE.fullmatch(request.headers.get("Range", "").replace(" ", ""))
    condition = request.headers.get("If-Range", etag)
    if request.method != "GET" or found is None or condition != etag:  # a date is no ETag: then all of it
        return whole
    first, last = found.groups()
    if not first:
        if not last:
            return whole
        count = min(int(last), size)
        return Span(size - count, size) if count else None
    if last and int(last) < int(first):
        return whole
    if int(first) >= size:
        return None
    return Span(int(first), min(int(last) + 1 if last else int(first) + most, size))


def _pieces(storage: Storage, name: str, span: Span) -> tuple[Iterator[bytes], Any]:
    """The bytes of a span, and the opened local file. Opens at once, so that a missing file is known early."""
    opened: Any = storage.open(name, "rb")
    remote = getattr(opened, "obj", None)  # of django-storages: reading such a file would fetch all of it first
    if remote is not None:
        opened.close()
        body = remote.get(Range=f"bytes={span.start}-{span.stop - 1}")["Body"]
        return _closing(body.iter_chunks(PIECE), body), None
    opened.seek(span.start)
    return _closing(_read(opened, span.stop - span.start), opened), opened


def _read(opened: Any, left: int) -> Iterator[bytes]:
    while left > 0 and (piece := opened.read(min(PIECE, left))):
        left -= len(piece)
        yield piece


def _closing(pieces: Iterator[bytes], source: Any) -> Iterator[bytes]:
    try:
        yield from pieces
    finally:
        source.close()
