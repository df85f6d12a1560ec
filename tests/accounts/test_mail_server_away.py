"""Mails of accounts while the mail server is away or refuses: the page says so, and nothing breaks."""

from __future__ import annotations

import pytest
from allauth.account.models import EmailAddress
from django.core.cache import cache
from django.test import Client

from accounts.models import Racer
from tests.mail_server import mail_server

pytestmark = pytest.mark.django_db
PASSWORD = "correct-horse-77"
UNSENT = "The e-mail could not be sent"
SIGN_UP = {"username": "zed", "email": "zed@example.org", "password1": PASSWORD, "password2": PASSWORD}


@pytest.fixture(autouse=True)
def no_limits() -> None:
    cache.clear()  # so many mails to an address in so much time


REFUSALS = [{"HELLO": "421 Not now"}, {"zed@example.org": "550 No"}, {"DATA": "451 Later"}]


@pytest.mark.parametrize("answers", REFUSALS)
@pytest.mark.parametrize("verification", ["optional", "mandatory"])
def test_an_account_is_created_without_its_mail(settings, answers, verification):
    settings.ACCOUNT_EMAIL_VERIFICATION = verification
    with mail_server() as server:
        server.answers.update(answers)
        answer = Client().post("/accounts/signup/", SIGN_UP, follow=True)
    assert answer.status_code == 200
    assert UNSENT in answer.content.decode()
    assert "Confirmation e-mail sent" not in answer.content.decode()
    assert Racer.objects.filter(alias="zed").exists()


@pytest.mark.parametrize("answers", REFUSALS)
def test_a_reset_looks_the_same_for_an_address_that_nobody_has(answers):
    EmailAddress.objects.create(
        user=Racer.objects.create_user("zed", "zed@example.org", PASSWORD), email="zed@example.org", verified=True
    )
    with mail_server() as server:
        server.answers.update(answers | {"none@example.org": "550 No"})
        known, unknown = (
            Client().post("/accounts/password/reset/", {"email": f"{name}@example.org"}, follow=True)
            for name in ("zed", "none")
        )
    assert known.status_code == unknown.status_code == 200
    assert UNSENT in known.content.decode() and UNSENT in unknown.content.decode()
    assert server.recipients == []


def test_what_was_sent_is_confirmed():
    with mail_server() as server:
        answer = Client().post("/accounts/signup/", SIGN_UP, follow=True)
    assert server.recipients == ["zed@example.org"]
    assert UNSENT not in answer.content.decode()
