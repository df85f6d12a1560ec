"""Links lead where the operator says the site is, whatever ``Host`` a request was sent with."""

from __future__ import annotations

import re

import pytest
from django.core import mail
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from races.models import Visibility
from tests.factories import a_race

SITE = "https://race.example.org:8443"
FORGED = "localhost:666"
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def where(settings) -> None:
    """A site with an address of its own, which also answers to other names."""
    cache.clear()
    settings.SITE_URL = SITE
    settings.ALLOWED_HOSTS = ["race.example.org", "localhost", ".inner.example.org"]
    settings.CSRF_TRUSTED_ORIGINS = [SITE, "https://other.example.org:444"]
    settings.ALLOWED_HOSTS.append("other.example.org")


def sent_by(host: str, secure: bool = False) -> str:
    """The mail that a request with this Host makes the site send."""
    mail.outbox.clear()
    Client(headers={"host": host}).post("/accounts/password/reset/", {"email": "alice@example.org"}, secure=secure)
    return f"{mail.outbox[0].subject}\n{mail.outbox[0].body}"


def link_in(text: str) -> str:
    return re.search(r"(https?://\S+?)/accounts/", text)[1]


def test_no_mail_links_to_an_unconfigured_host_or_port(alice):
    text = sent_by(FORGED)
    assert ":666" not in text
    assert link_in(text) == SITE
    assert "race.example.org:8443" in text  # below the mail


def test_a_mail_to_an_unknown_address_has_no_forged_host(db):
    assert ":666" not in sent_by(FORGED)


@pytest.mark.parametrize(
    ("host", "secure", "origin"),
    [
        ("race.example.org:8443", True, SITE),
        ("race.example.org:666", True, SITE),
        ("race.example.org:8443", False, SITE),
        ("localhost", False, "http://localhost"),
        ("localhost:8443", True, "https://localhost:8443"),
        ("localhost:8000", False, SITE),
        ("web1.inner.example.org", False, "http://web1.inner.example.org"),
        ("web1.inner.example.org:80", False, SITE),
        ("other.example.org:444", True, "https://other.example.org:444"),
    ],
)
def test_links_start_with_the_configured_address(alice, host, secure, origin):
    assert link_in(sent_by(host, secure)) == origin


def test_a_site_answering_to_any_host_links_to_its_own(alice, settings):
    settings.ALLOWED_HOSTS = ["*"]
    assert link_in(sent_by("evil.example.com")) == SITE


def test_pages_feeds_and_api_have_no_forged_host(alice):
    race = a_race(timezone.now(), slug="friends", organiser=alice, visibility=Visibility.INVITATION)
    a_race(timezone.now(), slug="open")
    client = Client(headers={"host": FORGED})
    client.force_login(alice)
    paths = ("/", "/races/open/", "/races/open/board.atom", f"/races/{race.slug}/", f"/races/{race.slug}/edit/")
    for path in (*paths, "/settings/tokens/", "/api/docs/", "/api/v1/races/?page_size=1", "/api/schema/", "/about/"):
        answer = client.get(path)
        assert answer.status_code == 200, path
        assert "localhost:666" not in answer.content.decode(), path
    assert f"{SITE}/races/join/" in client.get(f"/races/{race.slug}/edit/").content.decode()
    assert client.get("/api/v1/races/?page_size=1").json()["next"] in (None, f"{SITE}/api/v1/races/?page=2&page_size=1")


def test_a_disallowed_host_is_refused(alice):
    assert Client(headers={"host": "evil.example.com"}).get("/about/").status_code == 400


def test_forms_work_through_a_forwarded_port(alice):
    client = Client(headers={"host": "localhost:9000", "origin": "http://localhost:9000"}, enforce_csrf_checks=True)
    page = client.get("/accounts/login/").content.decode()
    token = re.search(r'name="csrfmiddlewaretoken" value="(\w+)"', page)[1]
    said = {"login": "alice", "password": "correct horse battery", "csrfmiddlewaretoken": token}
    assert client.post("/accounts/login/", said)["Location"] == "/"
