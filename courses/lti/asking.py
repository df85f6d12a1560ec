"""How the library asks a platform: as webhooks are sent, never this machine or its network, without redirects."""

import http.client
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from django.conf import settings

from league.webhooks import outgoing_requests as outgoing
from paddock.errors import PlatformFault, UserFault

LONGEST_ANSWER = 1 << 18
JSON, FORM = "application/json", "application/x-www-form-urlencoded"


@dataclass(frozen=True)
class Reply:
    """What the library reads of a response of ``requests``."""

    url: str
    status_code: int
    headers: Mapping[str, str]
    content: bytes

    @property
    def ok(self) -> bool:
        return 200 <= self.status_code < 300

    @property
    def text(self) -> str:
        return self.content.decode(errors="replace")

    def json(self) -> Any:
        """Raises ValueError."""
        return json.loads(self.content)


class PlatformSession:
    """What the library uses of a session of ``requests``. Raises UserFault("lti_address") for an address that is not
    asked, PlatformFault("lti_unreachable")."""

    def get(self, url: str, headers: Mapping[str, str] | None = None) -> Reply:
        return _ask("GET", url, None, {"Accept": JSON, **(headers or {})})

    def post(self, url: str, data: Any = None, headers: Mapping[str, str] | None = None) -> Reply:
        if isinstance(data, Mapping):
            return _ask("POST", url, urlencode(data).encode(), {"Content-Type": FORM, "Accept": JSON})
        return _ask("POST", url, (data or "").encode(), headers or {})


def refuse_unreachable(url: str) -> None:
    """Raises UserFault("lti_address") for an address that no platform of this site can have."""
    try:
        outgoing.refuse_undeliverable(url, allow_private=settings.LTI_PRIVATE)
    except UserFault as fault:
        raise _address(url) from fault


def _ask(method: str, url: str, body: bytes | None, headers: Mapping[str, str]) -> Reply:
    sent = {"User-Agent": "Paddock", **headers}
    try:
        answer = outgoing.ask(method, url, body, sent, allow_private=settings.LTI_PRIVATE, limit=LONGEST_ANSWER)
    except UserFault as fault:
        raise _address(url) from fault
    except (OSError, http.client.HTTPException) as error:
        raise PlatformFault("lti_unreachable", host=_host(url)) from error
    return Reply(url, answer.status, answer.headers, answer.body)


def _address(url: str) -> UserFault:
    return UserFault("lti_address", host=_host(url))


def _host(url: str) -> str:
    """For a sentence, of an address that may be no address."""
    return url.partition("://")[2].partition("/")[0][:100] or "?"
