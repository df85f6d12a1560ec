"""Documents as answers, made and compressed once for all readers."""

import gzip
import hashlib
import json
from collections.abc import Callable, Hashable
from typing import Any

from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response, patch_vary_headers
from django.utils.http import quote_etag

from core.streams.shared_pieces import lasting_value


def document_response(request: HttpRequest, key: Hashable, make: Callable[[], dict[str, Any]]) -> HttpResponse:
    """A document as JSON, made and compressed once for all readers: it has no secret and nothing of the request."""
    etag = quote_etag(hashlib.sha256(repr(key).encode()).hexdigest()[:32])
    response = get_conditional_response(request, etag=etag)
    if response is None:
        small = lasting_value(key, lambda: gzip.compress(json.dumps(make()).encode(), compresslevel=5, mtime=0))
        takes = "gzip" in request.headers.get("Accept-Encoding", "")
        response = HttpResponse(small if takes else gzip.decompress(small), content_type="application/json")
        if takes:
            response["Content-Encoding"] = "gzip"
    response["ETag"] = etag
    response["Cache-Control"] = "private, max-age=0, must-revalidate"
    patch_vary_headers(response, ("Accept-Encoding",))
    return response
