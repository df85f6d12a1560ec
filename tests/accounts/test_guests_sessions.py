"""Sessions of guests who only asked how to log in with a passkey: few, short, and gone in the end."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.sessions.models import Session
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from accounts.signing_in.receivers import PASSING_S
from config.tasks import old_sessions

PASSKEY = "/accounts/2fa/webauthn/login/"
PASSWORD = "correct horse battery"
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def counted_from_nothing() -> None:
    cache.clear()


def asks(client: Client) -> int:
    return client.get(PASSKEY, headers={"X-Requested-With": "XMLHttpRequest"}).status_code


def test_asking_for_challenges_cannot_flood_the_session_table(db):
    answers = [asks(Client()) for _ in range(70)]
    assert (answers.count(200), answers.count(429)) == (60, 10)
    assert Session.objects.count() == 60
    soon = timezone.now() + timedelta(seconds=PASSING_S + 5)
    assert not Session.objects.filter(expire_date__gt=soon).exists()
    Session.objects.update(expire_date=timezone.now() - timedelta(seconds=1))
    assert old_sessions() == 60


def test_logging_in_extends_a_short_lived_session(alice):
    client = Client()
    assert asks(client) == 200
    client.post("/accounts/login/", {"login": "alice", "password": PASSWORD, "remember": "on"})
    assert client.get("/settings/").status_code == 200
    assert Session.objects.get().expire_date > timezone.now() + timedelta(days=7)


def test_signing_up_extends_a_short_lived_session(db):
    client = Client()
    asks(client)
    sent = {"email": "zoe@example.org", "username": "zoe", "password1": PASSWORD, "password2": PASSWORD}
    assert client.post("/accounts/signup/", sent).status_code == 302
    assert client.get("/settings/").status_code == 200
    assert client.session.get_expiry_age() > PASSING_S
