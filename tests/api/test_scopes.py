"""What a token may be used for: every operation of the API with tokens of every scope."""

from __future__ import annotations

import re

import pytest
from django.core.cache import cache
from django.db import transaction
from django.utils import timezone
from knox.models import AuthToken
from rest_framework.test import APIClient
from rest_framework.throttling import ScopedRateThrottle

from accounts.scopes import SCOPES
from accounts.tokens.services import create_token
from config.api.urls import version_1
from league.webhooks.services import add_webhook
from tests.api.schema import SCHEMA

pytestmark = pytest.mark.django_db
METHODS = ("get", "post", "put", "patch", "delete")


@pytest.fixture(scope="module")
def operations() -> dict[tuple[str, str], dict]:
    """The schema's, by method and address."""
    paths = SCHEMA["paths"]
    return {(method, path): item[method] for path, item in paths.items() for method in METHODS if method in item}


def client_with(racer, *scopes: str) -> APIClient:
    client = APIClient()
    text = create_token(racer=racer, now=timezone.now(), scopes=scopes)[1]
    client.credentials(HTTP_AUTHORIZATION=f"Bearer {text}")
    return client


def refused(client: APIClient, method: str, path: str) -> str:
    """The scopes that the token was told to lack; empty where it was let through, whatever came of it then."""
    with transaction.atomic():  # it is to find the token there the next time
        answer = getattr(client, method)(re.sub(r"{\w+}", "1", path))
        transaction.set_rollback(True)
    body = answer.json() if answer.status_code == 403 else {}
    return body["params"]["scopes"] if body.get("code") == "scope_missing" else ""


@pytest.mark.parametrize("scope", SCOPES)
def test_a_token_of_one_scope_can_do_nothing_else(alice, operations, monkeypatch, scope):
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", dict.fromkeys(("upload", "write", "timing"), "9999/hour"))
    monkeypatch.setattr("config.api.views._authenticate", lambda *said: alice)
    client = client_with(alice, scope)
    for (method, path), operation in operations.items():
        needs = operation.get("x-token-scopes", [])
        missing = ", ".join(one for one in needs if one != scope)
        assert refused(client, method, path) == missing, f"{method} {path}"


def test_a_token_of_all_scopes_may_do_everything(alice, operations):
    client = client_with(alice, *SCOPES)
    for method, path in operations:
        cache.clear()
        assert refused(client, method, path) == "", f"{method} {path}"


def test_every_operation_has_its_scope(operations):
    """Each view says its own; only getting a token takes none, and giving one back any."""
    without = {(method, path) for (method, path), one in operations.items() if not one.get("x-token-scopes")}
    crossings = ("post", "/api/v1/timing/crossings/")  # with a sensor's token
    assert without == {("post", "/api/v1/auth/token/"), ("delete", "/api/v1/auth/token/"), crossings}
    every = {(method, path) for (method, path), one in operations.items() if len(one.get("x-token-scopes", ())) > 1}
    programs = {(method, path) for method, path in every if path.startswith("/api/v1/programs/")}
    account = {("get", "/api/v1/me/data/"), ("post", "/api/v1/me/alias/"), ("post", "/api/v1/me/deletion/")}
    assert every == {("delete", "/api/v1/auth/tokens/{key}/"), *account, *programs}
    for entry in version_1:
        for route in getattr(entry, "url_patterns", [entry]):
            view = route.callback.cls
            writes = any(hasattr(view, method) for method in METHODS[1:])
            assert hasattr(view, "token_scope") == writes, view.__name__


def test_reading_needs_read_and_writing_does_not(operations):
    for (method, path), operation in operations.items():
        reads = operation.get("x-token-scopes") == ["read"]
        all_data = path == "/api/v1/me/data/"  # which has what every scope reads
        assert reads == (method == "get" and not all_data), f"{method} {path}"


def test_public_reads_and_sessions_need_no_scope(alice):
    assert APIClient().get("/api/v1/races/").status_code == 200
    client = APIClient()
    client.force_login(alice)
    assert client.get("/api/v1/me/").status_code == 200


def test_a_token_can_be_requested_with_fewer_scopes_and_days(alice):
    said = {"login": "alice", "password": "correct horse battery"}
    answer = APIClient().post("/api/v1/auth/token/", said | {"scopes": ["race"], "days": 1})
    assert answer.data["scopes"] == ["race"]
    assert AuthToken.objects.get().expiry.isoformat()[:19] == answer.data["expires_at"][:19]
    for wrong in ({"scopes": []}, {"scopes": ["all"]}, {"days": 0}, {"days": 367}):
        assert APIClient().post("/api/v1/auth/token/", said | wrong).data["code"] == "invalid"
    assert APIClient().post("/api/v1/auth/token/", said).data["scopes"] == [*SCOPES]


def test_the_list_shows_scopes_expiry_and_last_use_of_tokens(alice):
    AuthToken.objects.create(user=alice)
    first, old = client_with(alice, "read").get("/api/v1/auth/tokens/").data["results"]
    assert (first["scopes"], first["is_this_one"]) == (["read"], True)
    assert first["last_used_at"] and first["expires_at"]
    assert (old["scopes"], old["expires_at"], old["last_used_at"]) == ([*SCOPES], None, None)


def test_a_read_only_token_does_not_get_webhook_secrets(alice):
    hook = add_webhook(owner=alice, url="https://example.org/hook")
    for path in ("/api/v1/webhooks/", f"/api/v1/webhooks/{hook.pk}/"):
        assert hook.secret not in client_with(alice, "read").get(path).content.decode()
        assert hook.secret in client_with(alice, "read", "organise").get(path).content.decode()
