"""A second factor: set up, asked for, lost, and demanded of admins."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from allauth.mfa.models import Authenticator
from allauth.mfa.recovery_codes.internal.auth import RecoveryCodes
from allauth.mfa.totp.internal.auth import TOTP
from django.core.cache import cache
from django.core.management import CommandError, call_command
from django.test import Client
from django.urls import URLResolver, get_resolver
from knox.models import AuthToken
from rest_framework.test import APIClient

from accounts.models import Racer
from config.middleware.accounts import ANYWHERE, OWN_ACCOUNT
from config.serving.streams.viewers import viewers_of
from config.settings.env import passkeys_work
from tests.accounts.one_time_codes import code_of

PASSWORD = "correct horse battery"
SECRET = "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ"
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def counted_from_nothing() -> None:
    cache.clear()


@pytest.fixture
def sam(db) -> Racer:
    return Racer.objects.create_superuser("sam", "sam@example.org", PASSWORD)


@pytest.fixture
def with_app(alice) -> Racer:
    """Alice, who has an app and codes on paper."""
    TOTP.activate(alice, SECRET)
    RecoveryCodes.activate(alice)
    return alice


def logged_in(racer: Racer) -> Client:
    client = Client()
    client.post("/accounts/login/", {"login": racer.alias, "password": PASSWORD})
    return client


def is_in(client: Client) -> bool:
    return client.get("/settings/").status_code == 200


def token_for(racer: Racer, **more: str):
    return APIClient().post("/api/v1/auth/token/", {"login": racer.alias, "password": PASSWORD} | more)


def test_setting_up_an_app_asks_for_the_password_again(alice):
    client = logged_in(alice)
    asked = client.get("/accounts/2fa/totp/activate/")
    assert asked["Location"].startswith("/accounts/reauthenticate/")
    page = client.post(asked["Location"], {"password": PASSWORD}, follow=True).content.decode()
    secret = re.search(r'id="totp-secret" value="(\w+)"', page)[1]
    assert 'src="data:image/svg+xml;base64,' in page
    assert client.post("/accounts/2fa/totp/activate/", {"code": "000000"}).status_code == 200
    paper = client.post("/accounts/2fa/totp/activate/", {"code": code_of(secret)}, follow=True).content.decode()
    assert len(re.findall(r"^(?:<pre><code>|.*<code>)?\d{8}$", paper, re.M)) == 10
    assert "Set up." in client.get("/accounts/2fa/").content.decode()


def test_with_an_app_the_password_alone_does_not_log_in(with_app):
    client = Client()
    answer = client.post("/accounts/login/", {"login": "alice", "password": PASSWORD})
    assert answer["Location"] == "/accounts/2fa/authenticate/"
    assert not is_in(client)
    assert "does not" not in client.get("/accounts/2fa/authenticate/").content.decode()
    client.post("/accounts/2fa/authenticate/", {"code": "12345"})
    assert not is_in(client)
    client.post("/accounts/2fa/authenticate/", {"code": code_of(SECRET)})
    assert is_in(client)


def test_a_recovery_code_logs_in_once(with_app):
    code = Authenticator.objects.get(type="recovery_codes").wrap().get_unused_codes()[0]
    first, second = logged_in(with_app), logged_in(with_app)
    first.post("/accounts/2fa/authenticate/", {"code": code})
    second.post("/accounts/2fa/authenticate/", {"code": code})
    assert (is_in(first), is_in(second)) == (True, False)


def test_codes_allow_five_guesses_in_five_minutes(with_app):
    client = logged_in(with_app)
    for number in range(5):
        client.post("/accounts/2fa/authenticate/", {"code": f"{number}"})
    client.post("/accounts/2fa/authenticate/", {"code": code_of(SECRET)})
    assert not is_in(client)
    assert token_for(with_app, code=code_of(SECRET)).status_code == 429


def test_the_api_accepts_a_code_with_the_password(with_app):
    assert token_for(with_app).data["code"] == "second_factor_needed"
    assert token_for(with_app, code="12345").data["code"] == "wrong_code"
    assert token_for(with_app, code=code_of(SECRET)).status_code == 201
    assert token_for(with_app, code=code_of(SECRET)).data["code"] == "wrong_code"  # used


def test_without_a_second_factor_no_code_is_needed(alice):
    assert token_for(alice, code="12345").status_code == 201


@pytest.mark.parametrize(
    "path",
    [
        "/accounts/2fa/totp/deactivate/",
        "/accounts/2fa/recovery-codes/",
        "/accounts/2fa/recovery-codes/download/",
        "/accounts/2fa/recovery-codes/generate/",
        "/accounts/2fa/webauthn/add/",
    ],
)
def test_changing_second_factors_needs_reauthentication(with_app, path):
    client = logged_in(with_app)
    client.post("/accounts/2fa/authenticate/", {"code": code_of(SECRET)})
    assert client.get(path)["Location"].startswith("/accounts/reauthenticate/")
    answer = client.post(path)
    assert answer.status_code == 405 or answer["Location"].startswith("/accounts/reauthenticate/")
    assert Authenticator.objects.count() == 2


def test_creating_a_token_needs_reauthentication(alice):
    client = logged_in(alice)
    asked = client.post("/settings/tokens/", {"scopes": "read", "days": "30"})
    assert asked["Location"].startswith("/accounts/reauthenticate/")
    assert not AuthToken.objects.exists()
    client.post(asked["Location"], {"password": "guess"})
    assert not AuthToken.objects.exists()
    page = client.post(asked["Location"], {"password": PASSWORD})
    assert re.search(r'id="new-token" value="(\w+)"', page.content.decode())
    assert "no-store" in page["Cache-Control"]


def test_admins_without_a_required_second_factor_must_set_one_up(sam, settings):
    session, token = logged_in(sam), token_for(sam).data["token"]
    settings.STAFF_SECOND_FACTOR = True
    for path in ("/admin/", "/", "/settings/tokens/"):
        assert session.get(path)["Location"] == "/accounts/2fa/", path
    assert "need a second factor" in session.get("/accounts/2fa/").content.decode()
    assert session.get("/api/v1/me/").json()["code"] == "second_factor_missing"
    assert token_for(sam).data["code"] == "second_factor_missing"
    by_token = Client().get("/api/v1/me/", headers={"Authorization": f"Bearer {token}"})
    assert (by_token.status_code, by_token.json()["code"]) == (403, "second_factor_missing")
    TOTP.activate(sam, SECRET)
    assert session.get("/admin/").status_code == 200
    assert Client().get("/api/v1/me/", headers={"Authorization": f"Bearer {token}"}).status_code == 200


def addresses(patterns=None, before: str = "/") -> Iterator[tuple[str, str]]:
    """Every address of the site with the name of its view; parameters are 1."""
    for pattern in get_resolver().url_patterns if patterns is None else patterns:
        route = re.sub(r"<[^>]+>", "1", before + str(pattern.pattern).removeprefix("^"))
        if isinstance(pattern, URLResolver):
            yield from addresses(pattern.url_patterns, route)
        elif not re.search(r"[(\\^$*]", route):
            yield route, pattern.name or ""


@pytest.mark.parametrize("method", ["get", "post"])
def test_no_page_or_operation_answers_an_admin_without_the_required_factor(sam, settings, method):
    client = Client()
    client.force_login(sam, backend="django.contrib.auth.backends.ModelBackend")
    settings.STAFF_SECOND_FACTOR = True
    asked, wrong = 0, []
    for address, name in addresses():
        if name in ANYWHERE or name.startswith(OWN_ACCOUNT) or address.startswith(("/health/", "/static/")):
            continue
        answer = getattr(client, method)(address)
        asked += 1
        if address.startswith("/api/"):
            is_kept_out = answer.status_code == 403 and answer.json()["code"] == "second_factor_missing"
        else:
            is_kept_out = answer.status_code == 302 and answer["Location"] == "/accounts/2fa/"
        if not is_kept_out and answer.status_code != 404:
            wrong.append(f"{address} ({name}): {answer.status_code}")
    assert wrong == [] and asked > 300


def test_the_stream_does_not_know_an_admin_without_the_required_factor(sam, settings):
    session = logged_in(sam).session.session_key
    assert viewers_of([session]) == {session: sam}
    settings.STAFF_SECOND_FACTOR = True
    assert viewers_of([session]) == {}


def test_removing_the_last_factor_shuts_an_admin_out_again(sam, settings):
    settings.STAFF_SECOND_FACTOR = True
    TOTP.activate(sam, SECRET)
    client = Client()
    client.force_login(sam, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get("/admin/").status_code == 200
    Authenticator.objects.filter(user=sam).delete()
    assert client.get("/admin/")["Location"] == "/accounts/2fa/"


def test_racers_do_not_need_the_factor_required_of_admins(alice, settings):
    settings.STAFF_SECOND_FACTOR = True
    assert is_in(logged_in(alice))
    assert token_for(alice).status_code == 201
    assert Client().get("/").status_code == 200


def test_recovery_codes_alone_are_not_a_second_factor(sam, settings):
    settings.STAFF_SECOND_FACTOR = True
    RecoveryCodes.activate(sam)
    assert logged_in(sam).get("/admin/")["Location"] == "/accounts/2fa/"


def test_an_operator_can_remove_a_lost_second_factor(with_app, capsys):
    call_command("forget_second_factor", "Alice")
    assert "alice logs in with the password alone" in capsys.readouterr().out
    assert is_in(logged_in(with_app))
    with pytest.raises(CommandError, match="has no second factor"):
        call_command("forget_second_factor", "alice")
    with pytest.raises(CommandError, match="no racer"):
        call_command("forget_second_factor", "nobody")


def test_an_admin_sees_a_second_factor_but_never_its_secret(with_app, sam):
    client = Client()
    client.force_login(sam)
    page = client.get(f"/admin/accounts/racer/{with_app.pk}/change/").content.decode()
    assert "TOTP Authenticator" in page
    assert SECRET not in page
    assert client.get("/admin/mfa/authenticator/").status_code == 404


@pytest.mark.parametrize(
    ("address", "offered"),
    [
        ("https://race.example.org", True),
        ("http://localhost:8000", True),
        ("http://race.example.org", False),
        ("http://127.0.0.1:8000", False),
        ("https://192.0.2.1", False),
        ("https://[::1]:8000", False),
    ],
)
def test_passkeys_are_offered_where_browsers_support_them(address, offered):
    assert passkeys_work(address) is offered
