"""The HTTP client for the API of one site."""

# The standard library's HTTP is enough. A refusal of the site keeps the site's own words (:class:`SiteRefusal`); every
# other failure on the way has a code of ours. Redirections are not followed, because they would carry the token.
# The HTTP modules are imported by the first request: a run at home sends none.

from __future__ import annotations

import json
import os
import time
import urllib.parse
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NotRequired, TypedDict

from paddock.errors import PaddockError, PlatformFault, UserFault

from .files import UNREADABLE, file_faults

if TYPE_CHECKING:
    from urllib.error import HTTPError
    from urllib.request import OpenerDirector, Request

PATIENCE_S = 60.0  # the answer to an upload comes after reading, conversion and checks
MOST_BYTES = 512 << 20  # of an answer
MOST_SENT_MB = 1024  # of a file; a site accepts 512 unless its operator raises that
MOST_PAGES = 1000  # of a list
RETRY_PAUSES_S = (0.5, 1.0, 2.0)  # before each further try of an unanswered request
_LONGEST_PAUSE_S = 10.0  # the longest pause that a site may request; the user decides about longer ones
_PASSING = (429, 502, 503, 504)
_IN_USE = "idempotency_key_in_use"  # the first try of this request is still being answered
_REFUSAL_BYTES = 1 << 20
_SHORT = 300


class ErrorDocument(TypedDict):
    """An error as a site or a command shows it. ``fault``: "user" or "platform"."""

    code: str
    message: str
    fault: NotRequired[str]
    params: NotRequired[Mapping[str, object]]


class SiteRefusal(Exception):
    """An error answer of the site."""

    def __init__(self, status: int, answer: ErrorDocument) -> None:
        super().__init__(f"{answer['code']}: {answer['message']}")
        self.status, self.answer = status, answer


def error_of(fault: PaddockError | SiteRefusal) -> ErrorDocument:
    """An error as a command shows it."""
    if isinstance(fault, SiteRefusal):
        return fault.answer
    return {"code": fault.code, "fault": fault.fault, "params": fault.params, "message": str(fault)}


class Served(dict[str, Any]):
    """An object in an answer of the site. A missing key raises UserFault("site_is_no_paddock")."""

    def __init__(self, site: str, pairs: Mapping[str, object]) -> None:
        super().__init__(pairs)
        self._site = site

    def __missing__(self, name: str) -> Any:
        raise UserFault("site_is_no_paddock", site=self._site, problem=f"its answer has no {name}")


class Site:
    """``address`` in the form of :func:`.settings.address`."""

    def __init__(self, address: str, token: str = "") -> None:
        self.address, self.token = address, token

    @cached_property
    def _opener(self) -> OpenerDirector:
        from urllib.request import HTTPRedirectHandler, build_opener

        class Stay(HTTPRedirectHandler):
            def redirect_request(
                self, req: Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
            ) -> None:
                raise UserFault("site_elsewhere", site=req.full_url, there=newurl[:_SHORT])

        return build_opener(Stay)

    def get(self, path: str, **query: object) -> Served:
        """The object at ``path`` below the API, see :class:`Served`. Raises as :meth:`raw`."""
        given = {name: value for name, value in query.items() if value not in (None, "")}
        asked = urllib.parse.urlencode(given, errors="replace")
        found = self._json(self.raw("GET", f"{path}?{asked}" if asked else path))
        if not isinstance(found, Served):
            raise UserFault("site_is_no_paddock", site=self.address, problem=f"no object lies at {path}")
        return found

    def pages(self, path: str, **query: object) -> list[Any]:
        """All results of a list. Raises as :meth:`raw`."""
        found: list[Any] = []
        number, last = 1, 1
        while number <= last:
            page = self.get(path, page=number, page_size=100, **query)
            found += page["results"]
            number, last = number + 1, page["pages"]
            if last > MOST_PAGES:
                raise UserFault("site_is_no_paddock", site=self.address, problem=f"a list of {last} pages")
        return found

    def post(self, path: str, body: Mapping[str, object] | None = None) -> Any:
        """Send JSON; the answer, None for an empty one. Raises as :meth:`raw`."""
        return self._send("POST", path, body or {})

    def patch(self, path: str, body: Mapping[str, object]) -> Any:
        """Change an object. Raises as :meth:`raw`."""
        return self._send("PATCH", path, body)

    def _send(self, method: str, path: str, body: Mapping[str, object]) -> Any:
        return self._json(self.raw(method, path, json.dumps(body).encode(), {"Content-Type": "application/json"}))

    def send_files(self, path: str, files: Mapping[str, Path], fields: Mapping[str, str]) -> Any:
        """Send a form with files. Raises as :meth:`raw`, and UserFault("home_file_unreadable", "too_large")."""
        boundary = os.urandom(16).hex()
        parts: list[bytes] = []
        for name, value in fields.items():
            parts.append(_head(boundary, f'name="{name}"') + value.encode(errors="replace"))
        for name, file in files.items():
            with file_faults(UNREADABLE, file), file.open("rb") as opened:  # a device may have no end
                data = opened.read((MOST_SENT_MB << 20) + 1)
            if len(data) > MOST_SENT_MB << 20:
                raise UserFault("too_large", limit_mb=MOST_SENT_MB)
            quoted = file.name.replace("\\", "_").replace('"', "_").replace("\r", "_").replace("\n", "_")
            parts.append(_head(boundary, f'name="{name}"; filename="{quoted}"', "application/octet-stream") + data)
        body = b"\r\n".join([*parts, f"--{boundary}--\r\n".encode()])
        return self._json(self.raw("POST", path, body, {"Content-Type": f"multipart/form-data; boundary={boundary}"}))

    def raw(self, method: str, path: str, data: bytes | None = None, headers: Mapping[str, str] = {}) -> bytes:
        """The bytes of an answer. Reads and POSTs are repeated while the site is away for a moment; all tries of a POST
        have the same Idempotency-Key, so they create one thing.

        Raises SiteRefusal; UserFault ``token_missing``, ``token_refused``, ``site_is_no_paddock``, ``site_elsewhere``;
        PlatformFault ``site_unreachable``, ``site_broken``.
        """
        if method == "POST":
            headers = {"Idempotency-Key": os.urandom(24).hex(), **headers}
        for pause_s in RETRY_PAUSES_S if method in ("GET", "POST") else ():
            try:
                return self._once(method, path, data, headers)
            except (SiteRefusal, PlatformFault) as error:
                wait_s = _pause_after(error, pause_s)
                if wait_s is None:
                    raise
                time.sleep(wait_s)
        return self._once(method, path, data, headers)

    def _once(self, method: str, path: str, data: bytes | None, headers: Mapping[str, str]) -> bytes:
        from http.client import HTTPException
        from urllib.error import HTTPError, URLError
        from urllib.request import Request

        quoted = urllib.parse.quote(path, safe="/?=&%", errors="backslashreplace")
        request = Request(f"{self.address}/api/v1{quoted}", data=data, method=method)
        for name, value in {"Accept": "*/*", "User-Agent": "paddock-racing", **headers}.items():
            request.add_header(name, value)
        if self.token:
            request.add_header("Authorization", f"Bearer {self.token}")
        try:
            with self._opener.open(request, timeout=PATIENCE_S) as answer:
                content: bytes = answer.read(MOST_BYTES + 1)
                if len(content) > MOST_BYTES:
                    raise PlatformFault("site_broken", site=self.address, problem="its answer is too large", status=200)
                return content
        except HTTPError as error:
            with error:
                raise self._refusal(error) from None
        except URLError as error:
            raise self._unreachable(error.reason) from error
        except (OSError, HTTPException) as error:  # during the answer
            raise self._unreachable(error) from error
        except ValueError as error:  # an address that is impossible in HTTP
            raise UserFault("site_address", address=self.address) from error

    def _json(self, content: bytes) -> Any:
        try:
            return json.loads(content, object_hook=lambda pairs: Served(self.address, pairs)) if content else None
        except (ValueError, RecursionError) as error:  # the latter: lists in lists in lists
            raise UserFault("site_is_no_paddock", site=self.address, problem="its answer is not JSON") from error

    def _unreachable(self, why: object) -> PlatformFault:
        return PlatformFault("site_unreachable", site=self.address, problem=str(why).rstrip(".")[:_SHORT])

    def _refusal(self, error: HTTPError) -> Exception:
        from http.client import HTTPException

        try:
            answer = json.loads(error.read(_REFUSAL_BYTES))
            known = isinstance(answer["code"], str) and isinstance(answer["message"], str)
        except (ValueError, KeyError, TypeError, RecursionError, OSError, HTTPException):
            known = False
        if not known:
            if error.code >= 500:
                return PlatformFault("site_broken", site=self.address, problem=f"HTTP {error.code}", status=error.code)
            return UserFault("site_is_no_paddock", site=self.address, problem=f"HTTP {error.code}")
        if error.code == 401:
            return UserFault("token_refused" if self.token else "token_missing", site=self.address)
        if error.code == 404 and answer["code"] == "not_found":
            return UserFault("not_on_site", site=self.address, what=urllib.parse.urlsplit(error.url).path)
        return SiteRefusal(error.code, answer)


def _pause_after(error: SiteRefusal | PlatformFault, usual_s: float) -> float | None:
    """Seconds before the request is repeated; None if repeating is of no use."""
    if isinstance(error, PlatformFault):
        return usual_s if error.params.get("status", 503) in _PASSING else None
    asked_s = (error.answer.get("params") or {}).get("wait_s", usual_s)
    passes = error.status in _PASSING or error.answer["code"] == _IN_USE
    if not passes or not isinstance(asked_s, (int, float)) or asked_s > _LONGEST_PAUSE_S:
        return None
    return max(usual_s, asked_s)


def _head(boundary: str, disposition: str, kind: str = "") -> bytes:
    lines = [f"--{boundary}", f"Content-Disposition: form-data; {disposition}"]
    return "\r\n".join([*lines, *([f"Content-Type: {kind}"] if kind else []), "", ""]).encode(errors="replace")
