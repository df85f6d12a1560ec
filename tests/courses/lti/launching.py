"""The walk of a launch with a client of Django's tests: log-in at the platform, its token, the arrival."""

from __future__ import annotations

from typing import Any
from urllib.parse import parse_qs, urlsplit

from django.test import Client

from tests.courses.lti.platform import Platform

SITE = "http://testserver"


def begin(client: Client, platform: Platform, sub: str, **more: str) -> dict[str, str]:
    """What the site asks the platform's log-in for."""
    asked = {"iss": platform.base, "login_hint": sub, "target_link_uri": f"{SITE}/lti/launch/", **more}
    answer = client.get("/lti/log-in/", asked)
    assert answer.status_code == 302, answer.content
    parts = urlsplit(answer["Location"])
    assert f"{parts.scheme}://{parts.netloc}{parts.path}" == f"{platform.base}/authorize"
    return {name: values[0] for name, values in parse_qs(parts.query).items()}


def send(client: Client, platform: Platform, sub: str, body: dict[str, Any] | None = None, /, **options: Any) -> Any:
    """The answer to a launch; ``body``: claims that differ, ``options``: of the signature."""
    asked = begin(client, platform, sub)
    token = platform.signed(platform.claims(sub, asked["nonce"], **(body or {})), **options)
    return client.post("/lti/launch/", {"id_token": token, "state": asked["state"]})


def launched(
    platform: Platform, sub: str, *, client: Client | None = None, do: tuple[str, ...] = (), **body: Any
) -> tuple[Client, Any]:
    """The client and the last answer, after a launch and the choices ``do`` on the page of arrival."""
    client = client or Client()
    answer = send(client, platform, sub, body)
    assert (answer.status_code, answer.headers.get("Location")) == (303, "/lti/arrival/"), answer.content
    answer = client.get("/lti/arrival/")
    for choice in do:
        answer = client.post("/lti/arrival/", {"do": choice})
    return client, answer


def refused(answer: Any) -> str:
    """The reason's code on a page that refuses."""
    return answer.content.decode().partition('data-code="')[2].partition('"')[0]
