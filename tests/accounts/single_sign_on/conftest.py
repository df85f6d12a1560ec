from __future__ import annotations

import json
import os
import re
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
import requests
from django.conf import settings
from django.core.cache import cache
from django.test import Client

from .provider_site import PASSWORD

# without the settings of tests.accounts.test_single_sign_on there are no such applications
collect_ignore_glob = [] if settings.OIDC else ["test_*.py"]

LOG_IN = "/accounts/oidc/sso/login/"


class ProviderControls:
    """What the provider says, and a person's way through its pages."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def says(self, name: str, **claims: Any) -> None:
        """The claims of a person from now on, besides a verified address and the name."""
        people = json.loads((self.folder / "people.json").read_text())
        usual = {"email": f"{name}@example.org", "email_verified": True, "preferred_username": name}
        people[name] = {key: value for key, value in (usual | claims).items() if value is not None}
        (self.folder / "people.json").write_text(json.dumps(people))

    def breaks(self, what: str) -> None:
        (self.folder / "fault").write_text(what)

    def send(self, address: str, name: str) -> str:
        """Sign in there as this person; the address that the browser is sent back to."""
        browser = requests.Session()
        page = browser.get(address)
        form = {"username": name, "password": PASSWORD, "csrfmiddlewaretoken": _token(page.text)}
        answer = browser.post(page.url, data=form, headers={"Referer": page.url}, allow_redirects=False)
        while answer.headers["Location"].startswith("/"):
            answer = browser.get(f"{settings.OIDC['issuer']}{answer.headers['Location']}", allow_redirects=False)
        return answer.headers["Location"]


def _token(page: str) -> str:
    return re.findall(r'name="csrfmiddlewaretoken" value="(\w+)"', page)[0]


@pytest.fixture
def provider():
    controls = ProviderControls(Path(os.environ["PADDOCK_TEST_PROVIDER"]))
    controls.breaks("")
    cache.clear()
    for name in ("mia", "noah", "newcomer"):
        controls.says(name)
    return controls


def begin(client: Client, **form: str) -> str:
    """Press the button; the address of the provider that the browser is sent to."""
    page = client.post(LOG_IN, form)
    assert page.status_code == 200, page.content.decode()
    return unescape(re.findall(r'http-equiv="refresh" content="0; url=([^"]+)"', page.content.decode())[0])


def come_back(client: Client, location: str):
    parts = urlsplit(location)
    return client.get(parts.path, {key: values[0] for key, values in parse_qs(parts.query).items()})


def log_in(client: Client, provider: ProviderControls, name: str, **form: str):
    """From the button through the provider's pages and back."""
    return come_back(client, provider.send(begin(client, **form), name))


def sign_up(client: Client, provider: ProviderControls, name: str, alias: str, **form: str):
    assert log_in(client, provider, name)["Location"] == "/accounts/3rdparty/signup/"
    return client.post("/accounts/3rdparty/signup/", {"username": alias} | form)


def alias_of(client: Client) -> str:
    """Who is logged in; empty: nobody."""
    return client.get("/theme/").wsgi_request.user.get_username()  # no page to draw
