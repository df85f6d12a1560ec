"""Logging in to the API and out of it."""

from __future__ import annotations

import pytest
from django.test import Client
from knox.models import AuthToken
from rest_framework.test import APIClient

from accounts.tokens.services import TOKENS_PER_RACER

PASSWORD = "correct horse battery"
pytestmark = pytest.mark.django_db


def log_in(login: str, password: str = PASSWORD):
    return APIClient().post("/api/v1/auth/token/", {"login": login, "password": password})


@pytest.mark.parametrize("login", ["alice", "ALICE", "alice@example.org", "Alice@example.org"])
def test_a_racer_gets_a_token_by_alias_or_email(alice, login):
    answer = log_in(login)
    assert answer.status_code == 201
    assert answer.data["alias"] == "alice"
    me = APIClient().get("/api/v1/me/", headers={"Authorization": f"Token {answer.data['token']}"})
    assert (me.status_code, me.data["alias"], me.data["email"]) == (200, "alice", "alice@example.org")


def test_only_a_hash_of_the_token_is_stored(alice):
    token = log_in("alice").data["token"]
    row = AuthToken.objects.get()
    assert token not in (row.digest, row.token_key)


def test_a_wrong_password_and_an_unknown_racer_look_the_same(alice):
    wrong, unknown = log_in("alice", "guess"), log_in("nobody", "guess")
    assert wrong.status_code == unknown.status_code == 400
    assert wrong.data == unknown.data
    assert wrong.data["code"] == "wrong_credentials"


def test_an_inactive_racer_gets_no_token(alice):
    alice.is_active = False
    alice.save()
    assert log_in("alice").data["code"] == "wrong_credentials"


def test_guessing_passwords_is_stopped(alice):
    codes = [log_in("alice", f"guess {n}").status_code for n in range(6)]
    assert codes[-1] == 429
    refused = log_in("alice")
    assert refused.status_code == 429
    assert refused.data["code"] == "throttled"
    assert refused.data["params"]["wait_s"] == int(refused["Retry-After"]) > 0


def test_an_unverified_address_gets_no_token_if_one_is_required(alice, settings):
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    answer = log_in("alice")
    assert (answer.status_code, answer.data["code"]) == (403, "email_unverified")


def test_logging_out_revokes_only_this_token(alice):
    first, second = log_in("alice").data["token"], log_in("alice").data["token"]
    client = APIClient()
    client.credentials(HTTP_AUTHORIZATION=f"Token {first}")
    assert client.delete("/api/v1/auth/token/").status_code == 204
    assert client.get("/api/v1/me/").status_code == 401
    client.credentials(HTTP_AUTHORIZATION=f"Token {second}")
    assert client.get("/api/v1/me/").status_code == 200


def test_a_session_has_no_token_to_revoke(alice):
    client = APIClient()
    client.force_login(alice)
    assert client.delete("/api/v1/auth/token/").data["code"] == "no_token"


def test_a_racer_has_a_limited_number_of_tokens(alice):
    for _ in range(TOKENS_PER_RACER):
        AuthToken.objects.create(user=alice)
    answer = log_in("alice")
    assert (answer.status_code, answer.data["code"]) == (409, "too_many_tokens")


def test_an_invalid_token_does_not_prevent_a_new_log_in(alice):
    client = APIClient()
    client.credentials(HTTP_AUTHORIZATION="Token long-gone")
    assert client.post("/api/v1/auth/token/", {"login": "alice", "password": PASSWORD}).status_code == 201


@pytest.mark.parametrize("header", ["Token nonsense", "Token \xe9\xff", "Token", "Token a b", "Token " + "x" * 5000])
def test_an_invalid_token_is_refused_in_the_error_format(alice, header):
    answer = Client().get("/api/v1/me/", headers={"Authorization": header})
    assert answer.status_code == 401
    assert answer["WWW-Authenticate"] == "Bearer"
    assert answer.json()["code"] == "authentication_failed"
    assert answer.json()["fault"] == "user"


def test_a_session_writes_only_with_its_csrf_token(alice):
    client = APIClient(enforce_csrf_checks=True)
    client.force_login(alice)
    assert client.get("/api/v1/me/").status_code == 200
    refused = client.delete("/api/v1/auth/token/")
    assert (refused.status_code, refused.data["code"]) == (403, "permission_denied")
    assert "CSRF" in refused.data["message"]
