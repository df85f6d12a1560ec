"""Sign-up by domain, and passwords for few: settings that hold without a provider, too."""

from __future__ import annotations

import pytest
from allauth.account.models import EmailAddress

from accounts.models import Racer
from accounts.signing_in.services import is_of_domain

pytestmark = pytest.mark.django_db
PASSWORD = "a long enough passphrase"


def sign_up(client, email: str):
    form = {"username": "alice", "email": email, "password1": PASSWORD, "password2": PASSWORD}
    return client.post("/accounts/signup/", form)


@pytest.mark.parametrize(
    ("email", "fits"),
    [
        ("a@example.edu", True),
        ("a@EXAMPLE.EDU", True),
        ("a@cs.example.org", True),
        ("a@example.org", False),
        ("a@notexample.edu", False),
        ("a@example.edu.evil.net", False),
        ("example.edu@evil.net", False),
        ('"a@example.edu"@evil.net', False),
        ("example.edu", True),  # no address at all, which the form refuses
    ],
)
def test_the_domain_is_what_stands_behind_the_last_at(email, fits):
    assert is_of_domain(email, ("example.edu", ".example.org")) is fits


def test_another_domain_cannot_sign_up(client, settings):
    settings.SIGN_UP_DOMAINS = ("example.edu",)
    page = sign_up(client, "alice@example.org").content.decode()
    assert "Use an address of: example.edu" in page and not Racer.objects.exists()
    sign_up(client, "alice@example.edu")
    assert Racer.objects.get().email == "alice@example.edu"


def test_a_racer_changes_to_no_address_of_another_domain(client, settings):
    racer = Racer.objects.create_user("alice", "alice@example.edu", PASSWORD)
    EmailAddress.objects.create(user=racer, email=racer.email, verified=True, primary=True)
    settings.SIGN_UP_DOMAINS = ("example.edu",)
    client.post("/accounts/login/", {"login": "alice", "password": PASSWORD})
    client.post("/accounts/reauthenticate/", {"password": PASSWORD})
    page = client.post("/accounts/email/", {"action_add": "", "email": "alice@example.org"}).content.decode()
    assert "Use an address of: example.edu" in page
    client.post("/accounts/email/", {"action_add": "", "email": "alice2@example.edu"})
    assert EmailAddress.objects.filter(email="alice2@example.edu").exists()


def test_an_account_of_another_domain_goes_on(client, settings):
    Racer.objects.create_user("alice", "alice@example.org", PASSWORD)
    settings.SIGN_UP_DOMAINS = ("example.edu",)
    client.post("/accounts/login/", {"login": "alice", "password": PASSWORD})
    assert client.get("/").wsgi_request.user.get_username() == "alice"
    client.logout()
    assert client.post("/accounts/password/reset/", {"email": "alice@example.org"}).status_code == 302
