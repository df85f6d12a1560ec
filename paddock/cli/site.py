"""One site over its API: a request, and what may come of it. The standard library's HTTP is enough for that.

What the site refuses is told in its own words (:class:`SiteRefusal`); everything else that goes wrong on the way is one
of ours, with a code. Redirections are not followed: a token would go along.
"""

from __future__ import annotations

import http.client
import json
import secrets
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from paddock.errors import PlatformFault, UserFault

PATIENCE_S = 60.0  # an upload is answered when it is read, converted and checked
MOST_BYTES = 512 << 20  # of an answer
MOST_PAGES = 1000  # of a list
_REFUSAL_BYTES = 1 << 20
_SHORT = 300


class SiteRefusal(Exception):
    """What the site answered in place of what was asked: ``{"code", "message", "fault", "params"}``."""

    def __init__(self, status: int, said: Mapping[str, Any]) -> None:
        super().__init__(f"{said['code']}: {said['message']}")
        self.status, self.said = status, dict(said)

    @property
    def theirs(self) -> bool:
        """Whether it is the site's fault, and the same may be sent again."""
        return self.said.get("fault") == "platform"


class _Answer(dict[str, Any]):
    """An object in an answer of the site. Asked for what it lacks it says so, for no Paddock answers like that."""

    def __init__(self, site: str, pairs: dict[str, Any]) -> None:
        super().__init__(pairs)
        self._site = site

    def __missing__(self, name: str) -> Any:
        raise UserFault("site_is_no_paddock", site=self._site, problem=f"its answer has no {name}")


class _Stay(urllib.request.HTTPRedirectHandler):
    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> None:
        raise UserFault("site_elsewhere", site=req.full_url, there=newurl[:_SHORT])


class Site:
    """``address`` in the form of :func:`.settings.address`."""

    def __init__(self, address: str, token: str = "") -> None:
        self.address, self.token = address, token
        self._opener = urllib.request.build_opener(_Stay)

    def get(self, path: str, **query: object) -> Any:
        """The object that lies at ``path`` below the API; a key that it lacks is told, see :class:`_Answer`. Raises as
        :meth:`raw`."""
        asked = urllib.parse.urlencode({name: value for name, value in query.items() if value not in (None, "")})
        found = self._json(self.raw("GET", f"{path}?{asked}" if asked else path))
        if not isinstance(found, dict):
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

    def post(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        """Send JSON; the answer, None for an empty one. Raises as :meth:`raw`."""
        data = json.dumps(body or {}).encode()
        return self._json(self.raw("POST", path, data, {"Content-Type": "application/json"}))

    def send_files(self, path: str, files: Mapping[str, Path], fields: Mapping[str, str]) -> Any:
        """Send a form with files. Raises as :meth:`raw`, and UserFault("home_file_unreadable")."""
        boundary = secrets.token_hex(16)
        parts: list[bytes] = []
        for name, value in fields.items():
            parts.append(_head(boundary, f'name="{name}"') + value.encode())
        for name, file in files.items():
            try:
                data = file.read_bytes()
            except OSError as error:
                raise UserFault("home_file_unreadable", path=str(file), problem=error.strerror or str(error)) from error
            quoted = file.name.replace("\\", "_").replace('"', "_").replace("\r", "_").replace("\n", "_")
            parts.append(_head(boundary, f'name="{name}"; filename="{quoted}"', "application/octet-stream") + data)
        body = b"\r\n".join([*parts, f"--{boundary}--\r\n".encode()])
        return self._json(self.raw("POST", path, body, {"Content-Type": f"multipart/form-data; boundary={boundary}"}))

    def raw(self, method: str, path: str, data: bytes | None = None, headers: Mapping[str, str] = {}) -> bytes:
        """The bytes of an answer.

        Raises SiteRefusal; UserFault ``token_missing``, ``token_refused``, ``site_is_no_paddock``, ``site_elsewhere``;
        PlatformFault ``site_unreachable``, ``site_broken``.
        """
        request = urllib.request.Request(
            f"{self.address}/api/v1{urllib.parse.quote(path, safe='/?=&%')}", data=data, method=method
        )
        for name, value in {"Accept": "*/*", "User-Agent": "paddock-racing", **headers}.items():
            request.add_header(name, value)
        if self.token:
            request.add_header("Authorization", f"Bearer {self.token}")
        try:
            with self._opener.open(request, timeout=PATIENCE_S) as answer:
                content: bytes = answer.read(MOST_BYTES + 1)
                if len(content) > MOST_BYTES:
                    raise PlatformFault("site_broken", site=self.address, problem="its answer is too large")
                return content
        except urllib.error.HTTPError as error:
            with error:
                raise self._refusal(error) from None
        except urllib.error.URLError as error:
            raise self._unreachable(error.reason) from error
        except (OSError, http.client.HTTPException) as error:  # while the answer came
            raise self._unreachable(error) from error
        except ValueError as error:  # an address that HTTP cannot say
            raise UserFault("site_address", address=self.address) from error

    def _json(self, content: bytes) -> Any:
        try:
            return json.loads(content, object_hook=lambda pairs: _Answer(self.address, pairs)) if content else None
        except (ValueError, RecursionError) as error:  # the latter: lists in lists in lists
            raise UserFault("site_is_no_paddock", site=self.address, problem="its answer is not JSON") from error

    def _unreachable(self, why: object) -> PlatformFault:
        return PlatformFault("site_unreachable", site=self.address, problem=str(why).rstrip(".")[:_SHORT])

    def _refusal(self, error: urllib.error.HTTPError) -> Exception:
        try:
            said = json.loads(error.read(_REFUSAL_BYTES))
            known = isinstance(said["code"], str) and isinstance(said["message"], str)
        except (ValueError, KeyError, TypeError, RecursionError, OSError, http.client.HTTPException):
            known = False
        if not known:
            if error.code >= 500:
                return PlatformFault("site_broken", site=self.address, problem=f"HTTP {error.code}")
            return UserFault("site_is_no_paddock", site=self.address, problem=f"HTTP {error.code}")
        if error.code == 401:
            return UserFault("token_refused" if self.token else "token_missing", site=self.address)
        if error.code == 404 and said["code"] == "not_found":
            return UserFault("not_on_site", site=self.address, what=urllib.parse.urlsplit(error.url).path)
        return SiteRefusal(error.code, said)


def _head(boundary: str, disposition: str, kind: str = "") -> bytes:
    lines = [f"--{boundary}", f"Content-Disposition: form-data; {disposition}"]
    return "\r\n".join([*lines, *([f"Content-Type: {kind}"] if kind else []), "", ""]).encode()
