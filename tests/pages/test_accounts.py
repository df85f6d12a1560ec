"""Signing up, logging in and out, passwords, country, tokens, theme, language, health."""

from __future__ import annotations

import re
from urllib.parse import urlencode

import pytest
from django.core import mail
from django.core.cache import cache
from django.utils import timezone
from knox.models import AuthToken

from accounts.models import Racer
from accounts.tokens.services import TOKENS_PER_RACER, create_token
from tests.pages.conftest import World

PASSWORD = "a long enough passphrase"
NEW = {"username": "Speedy_1", "email": "Speedy@Example.org", "password1": PASSWORD, "password2": PASSWORD}


def test_a_racer_signs_up_and_logs_in_by_alias_or_email(client, db) -> None:
    response = client.post("/accounts/signup/", NEW, follow=True)
    assert "Speedy_1" in response.content.decode()
    racer = Racer.objects.get(alias="Speedy_1")
    assert racer.email == "speedy@example.org"
    assert "/accounts/confirm-email/" in mail.outbox[0].body and "Hello from Paddock!" in mail.outbox[0].body
    for login in ("Speedy_1", "speedy_1", "speedy@example.org"):
        client.post("/accounts/logout/")
        assert "Log in" in client.get("/").content.decode()
        cache.clear()
        client.post("/accounts/login/", {"login": login, "password": PASSWORD})
        assert client.get("/settings/").status_code == 200, login


def test_signing_up_leads_to_the_page_the_racer_wanted(client, db) -> None:
    page = client.get("/accounts/signup/?next=/models/upload/").content.decode()
    assert 'name="next" value="/models/upload/"' in page
    assert client.post("/accounts/signup/", NEW | {"next": "/models/upload/"})["Location"] == "/models/upload/"


@pytest.mark.parametrize(
    ("referer", "back"),
    [
        ("http://testserver/races/open-race/?page=2#top", "/races/open-race/?page=2"),
        ("http://testserver", "/"),
        ("https://elsewhere.example/races/open-race/", "/"),
        ("", "/"),
    ],
)
def test_a_form_sent_after_a_logout_leads_back_to_its_page(client, world: World, referer, back) -> None:
    answer = client.post("/races/open-race/enter/", headers={"referer": referer} if referer else {})
    assert answer["Location"] == f"/accounts/login/?{urlencode({'next': back}, safe='/')}"


def test_a_page_that_needs_a_racer_is_shown_after_the_log_in(client, db) -> None:
    assert client.get("/models/upload/")["Location"] == "/accounts/login/?next=/models/upload/"


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"username": "no spaces"}, "username"),
        ({"username": "steward"}, "username"),
        ({"email": "no address"}, "email"),
        ({"password1": "short", "password2": "short"}, "password1"),
        ({"password2": "another passphrase"}, "password2"),
    ],
)
def test_an_invalid_sign_up_shows_the_error_beside_the_field(client, db, changes, field) -> None:
    response = client.post("/accounts/signup/", NEW | changes)
    assert response.context["form"].errors[field]
    assert not Racer.objects.exists()


def test_a_failed_login_does_not_say_which_part_was_wrong(client, world: World) -> None:
    answers = {
        re.sub(
            r"csrfmiddlewaretoken[^>]*>|value=\"(alice|nobody)\"",
            "",
            client.post("/accounts/login/", data).content.decode(),
        )
        for data in ({"login": "alice", "password": "wrong"}, {"login": "nobody", "password": "wrong"})
    }
    assert len(answers) == 1
    assert 'role="alert"' in answers.pop()


def test_a_forgotten_password_is_reset_by_email(client, db) -> None:
    client.post("/accounts/signup/", NEW)
    client.post("/accounts/logout/")
    assert (
        client.post("/accounts/password/reset/", {"email": NEW["email"]})["Location"]
        == "/accounts/password/reset/done/"
    )
    link = re.search(r"http://testserver(/accounts/password/reset/key/\S+)", mail.outbox[-1].body)[1]
    assert "Speedy_1" in mail.outbox[-1].body
    form = client.get(link)["Location"]
    assert "Choose a new password" in client.get(form).content.decode()
    client.post(form, {"password1": "quite another passphrase", "password2": "quite another passphrase"})
    cache.clear()
    client.post("/accounts/login/", {"login": "Speedy_1", "password": "quite another passphrase"})
    assert client.get("/settings/").status_code == 200
    assert "no longer works" in client.get(link, follow=True).content.decode()


def test_changing_the_password_needs_the_old_one(client, db) -> None:
    client.post("/accounts/signup/", NEW)
    data = {"oldpassword": "wrong", "password1": "another passphrase", "password2": "another passphrase"}
    assert client.post("/accounts/password/change/", data).status_code == 200
    assert client.post("/accounts/password/change/", data | {"oldpassword": PASSWORD}).status_code == 302


def test_a_new_email_address_takes_effect_once_confirmed(client, db) -> None:
    client.post("/accounts/signup/", NEW)
    asked = client.post("/accounts/email/", {"email": "other@example.org", "action_add": ""})
    assert "other@example.org" not in client.get("/accounts/email/").content.decode()
    client.post(asked["Location"], {"password": PASSWORD})
    assert "other@example.org" in client.get("/accounts/email/").content.decode()
    link = re.search(r"http://testserver(/accounts/confirm-email/\S+)", mail.outbox[-1].body)[1]
    assert "Yes, confirm" in client.get(link).content.decode()
    client.post(link)
    assert Racer.objects.get(alias="Speedy_1").email == "other@example.org"


def test_the_country_is_shown_on_boards(world: World) -> None:
    client = world.client("bob")
    assert client.post("/settings/", {"country": "XX"}).status_code == 200
    client.post("/settings/", {"country": "NZ"})
    html = client.get("/races/open-race/").content.decode()
    assert 'title="New Zealand">NZ<' in html
    client.cookies["django_language"] = "ko"
    assert 'title="뉴질랜드">NZ<' in client.get("/races/open-race/").content.decode()


def test_a_token_is_shown_once_then_works_until_revoked(world: World) -> None:
    client = world.client("alice")
    page = client.post("/settings/tokens/", {"scopes": "read", "days": "30"})
    token = re.search(r'id="new-token" value="(\w+)"', page.content.decode())[1]
    assert "no-store" in page["Cache-Control"]
    assert token not in client.get("/settings/tokens/").content.decode()
    anonymous = world.client("anonymous")
    assert anonymous.get("/api/v1/me/", headers={"Authorization": f"Token {token}"}).json()["alias"] == "alice"
    key = AuthToken.objects.get(user=world.alice).token_key
    assert world.client("bob").post(f"/settings/tokens/{key}/revoke/").status_code == 404
    client.post(f"/settings/tokens/{key}/revoke/")
    assert anonymous.get("/api/v1/me/", headers={"Authorization": f"Token {token}"}).status_code == 401


def test_a_racer_keeps_a_limited_number_of_tokens(world: World) -> None:
    for _ in range(TOKENS_PER_RACER):
        create_token(racer=world.alice, now=timezone.now())
    sent = {"scopes": "read", "days": "30"}
    html = world.client("alice").post("/settings/tokens/", sent, follow=True).content.decode()
    assert f"You already have {TOKENS_PER_RACER} API tokens" in html
    assert AuthToken.objects.count() == TOKENS_PER_RACER


def test_the_theme_is_kept_in_a_cookie_and_rendered_by_the_server(client, db) -> None:
    assert 'data-theme=""' in client.get("/about/").content.decode()
    assert client.post("/theme/", {"theme": "toggle", "next": "/about/"})["Location"] == "/about/"
    assert 'data-theme="dark"' in client.get("/about/").content.decode()
    client.post("/theme/", {"theme": "toggle"})
    assert 'data-theme="light"' in client.get("/about/").content.decode()
    client.post("/theme/", {"theme": ""})
    assert 'data-theme=""' in client.get("/about/").content.decode()


def test_the_form_chooses_the_language_and_the_browser_by_default(client, db) -> None:
    assert "이용 안내" in client.get("/about/", headers={"Accept-Language": "ko-KR,ko;q=0.9"}).content.decode()
    client.post("/i18n/setlang/", {"language": "ko", "next": "/about/"})
    html = client.get("/about/", headers={"Accept-Language": "en"}).content.decode()
    assert "이용 안내" in html and '<html lang="ko"' in html
