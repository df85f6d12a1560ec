"""Log-in by an LDAP directory, through the site's own form: a real slapd, with StartTLS."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from allauth.account.models import EmailAddress
from allauth.socialaccount.models import SocialAccount
from django.conf import settings as site
from django.core import mail
from django.core.cache import cache

from accounts.models import Racer
from accounts.single_sign_on import backends, examination
from accounts.single_sign_on.roles import apply_roles
from config.operations import doctor

from .conftest import alias_of
from .directory_server import PASSWORD, SUFFIX, change

pytestmark = pytest.mark.django_db
LOCAL = "a long enough passphrase"
LENA = f"dn: uid=lena,ou=people,{SUFFIX}"
ADMINS = f"dn: cn=paddock-admins,ou=groups,{SUFFIX}"


@pytest.fixture(autouse=True)
def fresh():
    cache.clear()


def send(client, name: str = "lena", password: str = PASSWORD, **more: str):
    return client.post("/accounts/login/", {"login": name, "password": password} | more)


def sign_up(client, alias: str = "speedy"):
    send(client)
    return client.post("/accounts/3rdparty/signup/", {"username": alias, "email": "lena@example.org"})


def modify(ldif: str) -> None:
    change(urlsplit(site.LDAP["uri"]).port, ldif)


def test_the_first_log_in_asks_for_an_alias_and_later_ones_for_nothing(client):
    assert "name at Example LDAP" in client.get("/accounts/login/").content.decode()
    assert send(client)["Location"] == "/accounts/3rdparty/signup/"
    page = client.get("/accounts/3rdparty/signup/").content.decode()
    assert 'value="lena"' in page and 'value="lena@example.org"' in page and "Example LDAP" in page
    sign_up(client)
    racer = Racer.objects.get()
    assert alias_of(client) == racer.alias == "speedy" and not racer.has_usable_password()
    client.post("/accounts/logout/")
    assert send(client, next="/races/")["Location"] == "/races/"
    assert alias_of(client) == "speedy"
    client.post("/accounts/logout/")
    send(client, "lena@example.org")
    assert alias_of(client) == "speedy"


def test_a_wrong_password_is_refused_and_counted(client):
    sign_up(client)
    client.post("/accounts/logout/")
    for _ in range(5):
        page = send(client, password="wrong")
        assert "not correct" in page.content.decode()
    assert "Too many" in send(client).content.decode()
    assert alias_of(client) == ""


def test_a_first_log_in_with_the_right_password_is_no_wrong_attempt(client):
    for _ in range(7):
        assert send(client)["Location"] == "/accounts/3rdparty/signup/"


@pytest.mark.parametrize("name", ["*", "le*", "lena)(uid=*", "", "nobody"])
def test_a_name_is_no_pattern(client, name):
    assert send(client, name).status_code == 200
    assert alias_of(client) == "" and not client.session.get("socialaccount_sociallogin")


def test_a_name_with_characters_of_filters_works(client):
    assert send(client, "old*boss")["Location"] == "/accounts/3rdparty/signup/"


def test_a_local_racer_of_the_same_alias_is_somebody_else(client):
    """Neither gets into the account of the other."""
    local = Racer.objects.create_user("lena", "another@example.org", LOCAL)
    send(client, password=LOCAL)
    assert alias_of(client) == "lena"
    client.post("/accounts/logout/")
    assert send(client)["Location"] == "/accounts/3rdparty/signup/"
    sign_up(client, "speedy")
    assert alias_of(client) == "speedy" and SocialAccount.objects.get().user != local


def test_an_address_of_the_directory_opens_no_account_unless_the_operator_vouches_for_it(client, settings):
    racer = Racer.objects.create_user("boss", "lena@example.org", LOCAL)
    EmailAddress.objects.create(user=racer, email="lena@example.org", verified=True, primary=True)
    page = sign_up(client)
    assert alias_of(client) == "" and "exists already" in page.content.decode()
    settings.SSO_VERIFIED_DOMAINS = ("example.org",)
    send(client)
    assert alias_of(client) == "boss"


def test_the_address_is_verified_by_mail(client):
    sign_up(client)
    assert not EmailAddress.objects.get().verified and mail.outbox[0].to == ["lena@example.org"]


def test_a_name_that_is_given_to_another_person_is_another_racer(client):
    sign_up(client)
    client.post("/accounts/logout/")
    entry = f"objectClass: inetOrgPerson\ncn: Lena\nsn: Other\nmail: lena2@example.org\nuserPassword: {PASSWORD}"
    modify(f"{LENA}\nchangetype: delete\n\n{LENA}\nchangetype: add\n{entry}\n")
    assert send(client)["Location"] == "/accounts/3rdparty/signup/"
    assert alias_of(client) == ""
    modify(f"{LENA}\nchangetype: modify\nreplace: mail\nmail: lena@example.org\n")


def test_groups_give_roles_and_take_them_at_the_next_log_in(client):
    sign_up(client)
    racer = Racer.objects.get()
    assert racer.is_superuser and racer.is_staff
    client.post("/accounts/logout/")
    member = f"member: uid=lena,ou=people,{SUFFIX}"
    modify(f"{ADMINS}\nchangetype: modify\ndelete: member\n{member}\n")
    try:
        send(client)
    finally:
        modify(f"{ADMINS}\nchangetype: modify\nadd: member\n{member}\n")
    racer.refresh_from_db()
    assert alias_of(client) == "speedy" and not (racer.is_superuser or racer.is_staff)


def test_without_a_base_of_groups_roles_stay(client, settings):
    settings.LDAP = site.LDAP | {"group_base": ""}
    sign_up(client)
    assert apply_roles(racer=Racer.objects.get(), groups=["paddock-admins"]) == ["+admin"]
    client.post("/accounts/logout/")
    send(client)
    assert Racer.objects.get().is_superuser


def test_deactivated_racers_stay_out(client):
    sign_up(client)
    client.post("/accounts/logout/")
    Racer.objects.update(is_active=False)
    assert send(client)["Location"] == "/accounts/inactive/"
    assert alias_of(client) == ""


@pytest.mark.parametrize(
    "wrong",
    [{"uri": "ldap://127.0.0.1:9"}, {"ca_file": ""}, {"bind_password": "wrong"}, {"group_base": "ou=none,dc=nowhere"}],
)
def test_a_directory_that_cannot_be_asked_is_named_and_local_passwords_work(client, settings, wrong):
    sign_up(client)
    client.post("/accounts/logout/")
    settings.LDAP = site.LDAP | wrong
    Racer.objects.create_user("local", "local@example.org", LOCAL)
    page = send(client)
    assert page.status_code == 200 and "does not answer" in page.content.decode()
    token = client.post("/api/v1/auth/token/", {"login": "lena", "password": PASSWORD}, "application/json")
    assert (token.status_code, token.json()["code"]) == (503, "ldap_unreachable")
    send(client, "local", LOCAL)
    assert alias_of(client) == "local"


def test_without_its_packages_the_form_says_what_to_install(client, monkeypatch):
    monkeypatch.setattr(backends, "is_installed", lambda: False)
    assert "make ldap" in send(client).content.decode()


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({}, "answers"),
        ({"bind_password": "wrong"}, "Invalid credentials"),
        ({"uri": "ldap://127.0.0.1:9"}, "it cannot be asked"),
        ({"uri": "ldap://ldap.invalid", "start_tls": False}, "in the clear"),
    ],
)
def test_the_doctor_asks_the_directory(settings, wrong, problem):
    settings.OIDC = {}
    settings.LDAP = site.LDAP | wrong
    assert problem in next(doctor.log_in()).detail


def test_the_doctor_names_the_command_that_installs_the_packages(settings, monkeypatch):
    settings.OIDC = {}
    monkeypatch.setattr(examination, "is_installed", lambda: False)
    assert [(line.status, "make ldap" in line.detail) for line in doctor.log_in()] == [("fail", True)]


def test_a_distinguished_name_by_a_template_needs_no_search(client, settings):
    template = f"uid=%(user)s,ou=people,{SUFFIX}"
    settings.LDAP = site.LDAP | {"user_base": "", "user_dn": template, "bind_dn": "", "bind_password": ""}
    sign_up(client)
    assert alias_of(client) == "speedy"
    client.post("/accounts/logout/")
    assert send(client, "lena,ou=people").status_code == 200


def test_the_api_gives_tokens_for_the_directorys_password(client):
    def ask(password: str = PASSWORD):
        sent = {"login": "lena", "password": password}
        return client.post("/api/v1/auth/token/", sent, content_type="application/json")

    assert (ask().status_code, ask().json()["code"]) == (403, "sso_first_log_in")
    sign_up(client)
    client.post("/accounts/logout/")
    assert (ask().status_code, ask().json()["alias"]) == (201, "speedy")
    assert ask("wrong").status_code == 400


def test_an_empty_password_is_no_password(client):
    send(client, password="")
    assert alias_of(client) == ""
    sent = {"login": "lena", "password": " "}
    assert client.post("/api/v1/auth/token/", sent, content_type="application/json").status_code == 400
