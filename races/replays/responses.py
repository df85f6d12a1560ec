"""Documents as answers, made and compressed once for all readers."""

import gzip
import hashlib
import json
from collections.abc import Callable, Hashable, Mapping

from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response, patch_vary_headers
from django.utils.http import quote_etag

from core.streams.shared_pieces import lasting_value
from paddock.errors import PlatformFault

Make = Callable[[], Mapping[str, object]]


def document_response(request: HttpRequest, key: Hashable, make: Make) -> HttpResponse:
    """A document as JSON, made and compressed once for all readers: it has no secret and nothing of the request."""
    return _response(request, key, lambda: compressed(key, make))


def documents_response(request: HttpRequest, parts: Mapping[str, tuple[Hashable, Make]]) -> HttpResponse:
    """Several documents by their names as one, each with its key, without those whose files cannot be read."""
    found: dict[str, tuple[Hashable, bytes]] = {}
    for name, (key, make) in parts.items():
        try:
            found[name] = key, compressed(key, make)
        except PlatformFault:
            continue
    whole_key = "documents", *((name, key) for name, (key, _small) in found.items())

    def joined() -> bytes:
        texts = (f"{json.dumps(name)}:".encode() + gzip.decompress(small) for name, (_key, small) in found.items())
        return _small(b"{" + b",".join(texts) + b"}")

    return _response(request, whole_key, lambda: lasting_value(whole_key, joined))


def compressed(key: Hashable, make: Make) -> bytes:
    """A document as it is sent, made once for all readers of a language."""
    return lasting_value(key, lambda: _small(json.dumps(make(), separators=(",", ":")).encode()))


def _small(content: bytes) -> bytes:
    return gzip.compress(content, compresslevel=5, mtime=0)


def _response(request: HttpRequest, key: Hashable, read: Callable[[], bytes]) -> HttpResponse:
    etag = quote_etag(hashlib.sha256(repr(key).encode()).hexdigest()[:32])
    response = get_conditional_response(request, etag=etag)
    if response is None:
        small = read()
        takes = "gzip" in request.headers.get("Accept-Encoding", "")
        response = HttpResponse(small if takes else gzip.decompress(small), content_type="application/json")
        if takes:
            response["Content-Encoding"] = "gzip"
    response["ETag"] = etag
    response["Cache-Control"] = "private, max-age=0, must-revalidate"
    patch_vary_headers(response, ("Accept-Encoding",))
    return response
