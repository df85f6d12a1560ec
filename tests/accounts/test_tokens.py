"""API tokens: what for, until when, and what ends them all."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.totp.internal.auth import TOTP
from django.core import mail
from django.core.cache import cache
from django.db import IntegrityError
from django.test import Client
from django.utils import timezone
from knox.models import AuthToken

from accounts.models import KnownAddress, Racer, TokenGrant
from accounts.scopes import SCOPES
from accounts.tokens.services import NOTED_AGAIN_AFTER, create_token, note_use, tokens_of
from league.webhooks.services import add_webhook

PASSWORD, NEW, OTHER = "correct horse battery", "quite another passphrase", "a third long passphrase"
CHANGE = {"oldpassword": PASSWORD, "password1": NEW, "password2": NEW}
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def counted_from_nothing() -> None:
    cache.clear()


def a_token(racer: Racer, **more) -> str:
    return create_token(racer=racer, now=timezone.now(), **more)[1]


def works(text: str) -> bool:
    return Client().get("/api/v1/me/", headers={"Authorization": f"Bearer {text}"}).status_code == 200


def logged_in(racer: Racer, password: str = PASSWORD) -> Client:
    client = Client()
    client.post("/accounts/login/", {"login": racer.alias, "password": password})
    return client


def is_in(client: Client) -> bool:
    return client.get("/settings/").status_code == 200


def reset(address: str, client: Client | None = None) -> None:
    """Whoever reads the mailbox chooses a new password."""
    client = client or Client()
    mail.outbox.clear()
    client.post("/accounts/password/reset/", {"email": address})
    link = re.search(r"(/accounts/password/reset/key/\S+)", mail.outbox[-1].body)[1]
    form = client.get(link)["Location"]
    assert client.post(form, {"password1": NEW, "password2": NEW}).status_code == 302


def test_a_token_expires_after_the_default_time(alice, settings):
    settings.TOKEN_DAYS = 3
    token, text = create_token(racer=alice, now=timezone.now())
    assert abs(token.expiry - timezone.now() - timedelta(days=3)) < timedelta(minutes=1)
    assert works(text)
    AuthToken.objects.update(expiry=timezone.now() - timedelta(seconds=1))
    assert not tokens_of(alice, timezone.now()).exists()
    assert not works(text)


def test_expired_tokens_make_room_for_new_ones(alice):
    for _ in range(20):
        a_token(alice)
    AuthToken.objects.update(expiry=timezone.now() - timedelta(seconds=1))
    assert works(a_token(alice))
    assert AuthToken.objects.count() == 1


def test_the_database_refuses_a_token_without_a_scope(alice):
    with pytest.raises(IntegrityError):
        create_token(racer=alice, now=timezone.now(), scopes=[])


def test_the_database_refuses_an_unknown_scope(alice):
    with pytest.raises(ValueError, match="everything"):
        create_token(racer=alice, now=timezone.now(), scopes=["everything"])


def test_a_token_older_than_scopes_has_all_and_never_expires(alice):
    text = AuthToken.objects.create(user=alice)[1]
    assert not TokenGrant.objects.exists()
    assert "everything" in logged_in(alice).get("/settings/tokens/").content.decode()
    assert works(text)
    grant = TokenGrant.objects.get()
    assert grant.scopes == [*SCOPES]
    assert grant.last_used_at is not None
    assert grant.token.expiry is None


def test_last_use_is_recorded_to_ten_minutes(alice, django_assert_num_queries, now):
    grant = create_token(racer=alice, now=now)[0].grant
    note_use(grant=grant, now=now)
    with django_assert_num_queries(0):
        note_use(grant=grant, now=now + NOTED_AGAIN_AFTER / 2)
    note_use(grant=grant, now=now + NOTED_AGAIN_AFTER)
    assert TokenGrant.objects.get().last_used_at == now + NOTED_AGAIN_AFTER


def test_the_page_creates_a_token_with_the_ticked_scopes(alice):
    client = logged_in(alice)
    asked = client.post("/settings/tokens/", {"scopes": ["read", "train"], "days": "7"})
    page = client.post(asked["Location"], {"password": PASSWORD}).content.decode()
    text = re.search(r'id="new-token" value="(\w+)"', page)[1]
    grant = TokenGrant.objects.get()
    assert grant.scopes == ["read", "train"]
    assert abs(grant.token.expiry - timezone.now() - timedelta(days=7)) < timedelta(minutes=1)
    assert "–" in page
    assert works(text)
    shown = client.get("/settings/tokens/").content.decode()
    assert re.findall(r'<span\s+class="tag"\s+lang="en">(\w+)</span>', shown) == ["read", "train"]
    assert "<td>–</td>" not in shown


@pytest.mark.parametrize(
    "sent", [{}, {"days": "7"}, {"scopes": ["read"], "days": "9999"}, {"scopes": ["x"], "days": "7"}]
)
def test_the_page_refuses_a_token_with_no_scope_or_too_long_a_life(alice, sent):
    client = logged_in(alice)
    client.post("/accounts/reauthenticate/", {"password": PASSWORD})
    client.post("/settings/tokens/", sent)
    assert not AuthToken.objects.exists()


def test_a_new_password_revokes_tokens_and_other_sessions(alice):
    here, there, text = logged_in(alice), logged_in(alice), a_token(alice)
    assert here.post("/accounts/password/change/", CHANGE).status_code == 302
    assert (is_in(here), is_in(there), works(text)) == (True, False, False)
    assert KnownAddress.objects.count() == 1  # of here


def test_a_password_reset_revokes_all_tokens_and_sessions(alice):
    EmailAddress.objects.create(user=alice, email=alice.email, verified=True, primary=True)
    there, text = logged_in(alice), a_token(alice)
    reset(alice.email)
    assert (is_in(there), works(text)) == (False, False)
    assert is_in(logged_in(alice, NEW))


def reset_link(client: Client, address: str) -> str:
    mail.outbox.clear()
    client.post("/accounts/password/reset/", {"email": address})
    return re.search(r"(/accounts/password/reset/key/\S+)", mail.outbox[-1].body)[1]


def chooses(client: Client, link: str, password: str) -> bool:
    """Whether a reset link leads to a form that sets the password."""
    form = client.get(link).get("Location", "")
    return bool(form) and client.post(form, {"password1": password, "password2": password}).status_code == 302


def test_a_reset_link_works_once(alice):
    EmailAddress.objects.create(user=alice, email=alice.email, verified=True, primary=True)
    first, second = Client(), Client()
    older, newer = (reset_link(first, alice.email) for _ in range(2))
    opened = second.get(older)["Location"]  # the form is open in another window
    assert chooses(first, newer, NEW)
    for link in (older, newer):
        assert not chooses(Client(), link, OTHER) and not chooses(first, link, OTHER)
    assert second.post(opened, {"password1": OTHER, "password2": OTHER}).status_code == 200
    alice.refresh_from_db()
    assert alice.check_password(NEW)


@pytest.mark.parametrize("change", ["password", "address", "locked"])
def test_a_reset_link_ends_with_what_it_was_made_for(alice, change):
    EmailAddress.objects.create(user=alice, email=alice.email, verified=True, primary=True)
    link = reset_link(Client(), alice.email)
    if change == "password":
        alice.set_password(NEW)
    elif change == "address":
        EmailAddress.objects.filter(user=alice).update(email="new@example.org")
        alice.email = "new@example.org"
    else:
        alice.is_active = False
    alice.save()
    before = Racer.objects.get().password
    chooses(Client(), link, OTHER)
    assert Racer.objects.get().password == before


@pytest.mark.parametrize("how", ["admin site", "unusable", "code"])
def test_every_way_to_change_the_password_revokes_tokens(alice, how):
    text = a_token(alice)
    if how == "admin site":
        client = Client()
        client.force_login(Racer.objects.create_superuser("sam", "sam@example.org", None))
        sent = {"password1": NEW, "password2": NEW, "usable_password": "true"}
        assert client.post(f"/admin/accounts/racer/{alice.pk}/password/", sent).status_code == 302
    else:
        alice.set_unusable_password() if how == "unusable" else alice.set_password(NEW)
        alice.save()
    assert not works(text)


def test_rehashing_a_password_revokes_nothing(alice, settings):
    text = a_token(alice)
    settings.PASSWORD_HASHERS = ["django.contrib.auth.hashers.ScryptPasswordHasher", *settings.PASSWORD_HASHERS]
    before = alice.password
    assert alice.check_password(PASSWORD)
    assert Racer.objects.get().password != before
    alice.team = "Blue"
    alice.save()
    assert works(text)


def test_the_owner_of_an_address_recovers_a_squatted_account(alice):
    """Mallory has signed up as alice, with Alice's address, and made everything that opens the account again."""
    EmailAddress.objects.create(user=alice, email=alice.email, primary=True)
    session, text = logged_in(alice), a_token(alice)
    EmailAddress.objects.create(user=alice, email="mallory@example.org")
    TOTP.activate(alice, "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ")
    add_webhook(owner=alice, url="https://mallory.example.org/hook")
    reset(alice.email)
    assert (is_in(session), works(text)) == (False, False)
    assert list(alice.emailaddress_set.values_list("email", "verified", "primary")) == [(alice.email, True, True)]
    assert not alice.webhooks.exists()
    assert is_in(logged_in(alice, NEW))  # without a second factor


def test_an_unconfirmed_new_address_cannot_reset_the_password(alice):
    EmailAddress.objects.create(user=alice, email=alice.email, primary=True)
    EmailAddress.objects.create(user=alice, email="mallory@example.org")
    mail.outbox.clear()
    Client().post("/accounts/password/reset/", {"email": "mallory@example.org"})
    assert not [message for message in mail.outbox if "/password/reset/key/" in message.body]


def test_a_reset_of_a_verified_account_keeps_its_second_factor(alice):
    EmailAddress.objects.create(user=alice, email=alice.email, verified=True, primary=True)
    TOTP.activate(alice, "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ")
    add_webhook(owner=alice, url="https://example.org/hook")
    reset(alice.email)
    assert alice.webhooks.exists()
    assert not is_in(logged_in(alice, NEW))


def test_a_password_reset_makes_its_address_known(alice):
    for number in range(30):
        Client(REMOTE_ADDR=f"203.0.113.{number}").post("/accounts/login/", {"login": "alice", "password": "guess"})
    away = Client(REMOTE_ADDR="198.51.100.7")
    assert away.post("/accounts/login/", {"login": "alice", "password": PASSWORD}).status_code == 200
    reset(alice.email, away)
    assert away.post("/accounts/login/", {"login": "alice", "password": NEW}).status_code == 302
