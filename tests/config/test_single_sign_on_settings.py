"""Settings of single sign-on: what the environment gives, and what stops the start."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from django.core.exceptions import ImproperlyConfigured

from config.operations.doctor import log_in
from config.settings import single_sign_on
from tests.shared import CHECKOUT

OIDC = {"PADDOCK_OIDC_ISSUER": "https://login.example.org/", "PADDOCK_OIDC_CLIENT_ID": "paddock"}
LDAP = {"PADDOCK_LDAP_URI": "ldap://ldap.example.org", "PADDOCK_LDAP_USER_BASE": "dc=example,dc=org"}


@pytest.fixture
def given(monkeypatch):
    def use(**values: str) -> None:
        for name in os.environ:
            if name.startswith(("PADDOCK_OIDC_", "PADDOCK_LDAP_", "PADDOCK_SSO_")):
                monkeypatch.delenv(name)
        for name, value in values.items():
            monkeypatch.setenv(name, value)

    return use


def test_nothing_is_set_by_default(given):
    given()
    assert single_sign_on.openid_connect() == single_sign_on.ldap() == {} and single_sign_on.roles() == ()


def test_the_label_is_the_host_unless_it_is_set(given):
    given(**OIDC)
    found = single_sign_on.openid_connect()
    assert (found["label"], found["issuer"]) == ("login.example.org", "https://login.example.org")
    assert found["scopes"] == ["openid", "profile", "email"]
    given(**OIDC, PADDOCK_OIDC_LABEL="Uni", PADDOCK_OIDC_SCOPES="openid,groups")
    assert single_sign_on.openid_connect()["label"] == "Uni"
    assert single_sign_on.openid_connect()["scopes"] == ["openid", "groups"]


def test_a_secret_comes_from_a_file(given, tmp_path):
    (tmp_path / "secret").write_text("hush\n")
    given(**OIDC, PADDOCK_OIDC_CLIENT_SECRET_FILE=str(tmp_path / "secret"))
    assert single_sign_on.openid_connect()["secret"] == "hush"


@pytest.mark.parametrize(
    "values",
    [
        {"PADDOCK_OIDC_CLIENT_ID": "paddock"},
        {"PADDOCK_OIDC_ISSUER": "https://login.example.org"},
        OIDC | {"PADDOCK_OIDC_ISSUER": "login.example.org"},
        OIDC | {"PADDOCK_OIDC_SCOPES": "profile email"},
        OIDC | {"PADDOCK_OIDC_CLIENT_SECRET_FILE": "/nowhere"},
        OIDC | {"PADDOCK_OIDC_CLIENT_SECRET_FILE": "/etc/hostname", "PADDOCK_OIDC_CLIENT_SECRET": "both"},
    ],
)
def test_a_provider_that_cannot_work_stops_the_start(given, values):
    given(**values)
    with pytest.raises(ImproperlyConfigured, match="PADDOCK_OIDC_"):
        single_sign_on.openid_connect()


@pytest.mark.parametrize(
    "values",
    [
        {"PADDOCK_LDAP_URI": "ldap://ldap.example.org"},
        LDAP | {"PADDOCK_LDAP_URI": "ldap.example.org"},
        LDAP | {"PADDOCK_LDAP_USER_DN": "uid=%(user)s,dc=example,dc=org"},
        LDAP | {"PADDOCK_LDAP_USER_FILTER": "(uid=alice)"},
        LDAP | {"PADDOCK_LDAP_ATTRIBUTES": "name=cn"},
        LDAP | {"PADDOCK_LDAP_CA_FILE": "/nowhere"},
        LDAP | {"PADDOCK_LDAP_GROUP_TYPE": "any"},
    ],
)
def test_a_directory_that_cannot_work_stops_the_start(given, values):
    given(**values)
    with pytest.raises(ImproperlyConfigured, match="PADDOCK_LDAP_"):
        single_sign_on.ldap()


@pytest.mark.parametrize(
    ("uri", "encrypts"), [("ldap://a.example.org", True), ("ldaps://a.example.org", False), ("ldapi:///run/x", False)]
)
def test_a_plain_connection_is_encrypted_before_anything_is_sent(given, uri, encrypts):
    given(**LDAP | {"PADDOCK_LDAP_URI": uri})
    assert single_sign_on.ldap()["start_tls"] is encrypts


@pytest.mark.parametrize("text", ["alice@example.edu", "edu", "example.edu\u200b"])
def test_a_domain_that_is_none_stops_the_start(given, text):
    given(DOMAINS=text)
    with pytest.raises(ImproperlyConfigured, match="DOMAINS"):
        single_sign_on.env_domains("DOMAINS")


def test_passwords_for_few_need_another_way_in(given):
    given(PADDOCK_PASSWORD_RACERS="Boss")
    assert single_sign_on.password_racers(provider=True) == {"boss"}
    with pytest.raises(ImproperlyConfigured):
        single_sign_on.password_racers(provider=False)


@pytest.mark.parametrize(("values", "loaded"), [({}, False), (OIDC, True)])
def test_applications_are_loaded_for_a_provider_alone(tmp_path, values, loaded):
    code = "import django, sys; django.setup(); sys.exit('allauth.socialaccount.models' in sys.modules)"
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PADDOCK_")}
    site = {"PADDOCK_DATA": str(tmp_path / "data"), "DJANGO_SETTINGS_MODULE": "config.settings"}
    assert subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, env=clean | site | values).returncode == loaded


def test_the_doctor_warns_of_domains_without_verified_addresses(settings):
    settings.SIGN_UP_DOMAINS = ("example.edu",)
    settings.ACCOUNT_EMAIL_VERIFICATION = "optional"
    assert [line.status for line in log_in()] == ["warn", "ok"]
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    assert [line.status for line in log_in()] == ["ok"]
