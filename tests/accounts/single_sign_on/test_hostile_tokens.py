"""Providers that answer wrongly, late or not at all, and answers that belong to somebody else."""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

import pytest
import requests
from django.conf import settings as site
from django.core.cache import cache

from accounts.models import Racer
from config.operations import doctor

from .conftest import LOG_IN, alias_of, begin, come_back, log_in, sign_up

pytestmark = pytest.mark.django_db


@pytest.mark.parametrize("fault", ["key", "nonce", "audience", "person"])
def test_a_token_with_a_fault_logs_nobody_in(client, provider, fault):
    provider.breaks(fault)
    page = log_in(client, provider, "mia")
    assert page.status_code == 401 and 'data-code="sso_failed"' in page.content.decode()
    assert alias_of(client) == "" and client.get("/accounts/3rdparty/signup/").status_code == 302


def test_each_log_in_has_its_own_state_nonce_and_challenge(client, provider):
    asked = [parse_qs(urlsplit(begin(client)).query) for _ in range(2)]
    for name in ("state", "nonce", "code_challenge"):
        assert asked[0][name] != asked[1][name] and len(asked[0][name][0]) >= 16
    assert asked[0]["code_challenge_method"] == ["S256"]


def test_a_code_counts_once(client, provider):
    location = provider.send(begin(client), "mia")
    assert come_back(client, location)["Location"] == "/accounts/3rdparty/signup/"
    assert come_back(client, location).status_code == 400


def test_a_code_of_another_log_in_is_refused(client, provider):
    """The code of one log-in, injected into the answer of another, fails its challenge."""
    code = parse_qs(urlsplit(provider.send(begin(client), "noah")).query)["code"][0]
    state = parse_qs(urlsplit(begin(client)).query)["state"][0]
    page = client.get("/accounts/oidc/sso/login/callback/", {"code": code, "state": state})
    assert page.status_code == 401 and alias_of(client) == ""


@pytest.mark.parametrize(("error", "status"), [("access_denied", 403), ("server_error", 401)])
def test_a_refusal_of_the_provider_is_shown(client, provider, error, status):
    state = parse_qs(urlsplit(begin(client)).query)["state"][0]
    page = client.get("/accounts/oidc/sso/login/callback/", {"error": error, "state": state})
    assert page.status_code == status and "Back to log-in" in page.content.decode()


@pytest.mark.parametrize("issuer", ["http://127.0.0.1:9", "http://127.0.0.1:9/realm"])
def test_a_provider_that_is_down_is_named(client, settings, issuer):
    cache.clear()
    settings.OIDC = site.OIDC | {"issuer": issuer}
    page = client.post(LOG_IN)
    assert page.status_code == 503 and "Example University does not answer" in page.content.decode()
    assert client.get("/accounts/login/").status_code == 200


def test_a_provider_that_goes_down_on_the_way_is_named(client, provider, settings):
    location = provider.send(begin(client), "mia")
    settings.OIDC = site.OIDC | {"issuer": "http://127.0.0.1:9"}
    assert come_back(client, location).status_code == 503


OTHER = b"""{"issuer": "https://other.example.org", "authorization_endpoint": "https://other.example.org/",
"token_endpoint": "https://other.example.org/token", "jwks_uri": "https://other.example.org/keys"}"""


@pytest.mark.parametrize("answer", [b"<html>", b"[]", b"{}", b'{"issuer": 3}', OTHER])
def test_an_answer_that_is_not_of_this_provider_is_refused(client, provider, monkeypatch, answer):
    made = requests.Response()
    made.status_code, made._content = 200, answer
    monkeypatch.setattr(requests.Session, "request", lambda *args, **kwargs: made)
    assert client.post(LOG_IN).status_code == 401


def test_the_doctor_asks_the_provider(provider, settings):
    assert list(doctor.log_in()) == [(site.OIDC["issuer"], "ok", "answers")]
    settings.OIDC = site.OIDC | {"issuer": "http://127.0.0.1:9"}
    assert [line.status for line in doctor.log_in()] == ["fail"]
    settings.OIDC = site.OIDC | {"issuer": "http://login.invalid"}
    assert "can read and change" in list(doctor.log_in())[-1].detail


def test_a_log_in_begins_by_a_form_of_this_site_alone(provider):
    from django.test import Client

    client = Client(enforce_csrf_checks=True)
    assert client.post(LOG_IN).status_code == 403
    assert client.get(LOG_IN)["Location"] == "/accounts/login/"
    assert client.post("/accounts/oidc/other/login/").status_code in (403, 404)


def test_log_ins_from_one_address_are_limited(client, provider, monkeypatch):
    monkeypatch.setitem(__import__("accounts.signing_in.attempt_limits", fromlist=["RATES"]).RATES, "challenge", "2/m")
    assert [client.post(LOG_IN).status_code for _ in range(3)] == [200, 200, 429]


def test_two_people_of_the_provider_are_two_racers(client, provider):
    sign_up(client, provider, "mia", "one")
    client.post("/accounts/logout/")
    sign_up(client, provider, "noah", "two")
    assert set(Racer.objects.values_list("alias", flat=True)) == {"one", "two"}
