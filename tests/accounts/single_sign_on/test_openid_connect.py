"""Log-in by OpenID Connect: the first time, later times, accounts that are there already, and roles."""

from __future__ import annotations

import re

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.totp.internal.auth import TOTP
from allauth.socialaccount.models import SocialAccount, SocialToken
from django.contrib.auth.models import Group
from django.core import mail

from accounts.leaving.services import delete_account
from accounts.models import Racer, SignUpInvitation
from core.audit.models import AuditEntry
from tests.accounts.one_time_codes import code_of

from .conftest import alias_of, begin, come_back, log_in, sign_up

pytestmark = pytest.mark.django_db
SECRET = "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ"
PASSWORD = "a long enough passphrase"


def verified(alias: str, email: str, **fields) -> Racer:
    racer = Racer.objects.create_user(alias, email, PASSWORD, **fields)
    EmailAddress.objects.create(user=racer, email=email, verified=True, primary=True)
    return racer


def test_the_first_log_in_asks_for_an_alias_and_proposes_the_name(client, provider):
    provider.says("mia", preferred_username="Mia Maier@example.org")
    assert log_in(client, provider, "mia")["Location"] == "/accounts/3rdparty/signup/"
    page = client.get("/accounts/3rdparty/signup/").content.decode()
    assert 'value="Mia-Maier"' in page and "Example University has confirmed your identity" in page
    assert not Racer.objects.exists()
    client.post("/accounts/3rdparty/signup/", {"username": "Speedy", "email": "other@example.org"})
    racer = Racer.objects.get()
    assert alias_of(client) == racer.alias == "Speedy"
    assert racer.email == "mia@example.org", "verified there, so it cannot be another"
    assert EmailAddress.objects.get().verified and not racer.has_usable_password()
    assert not mail.outbox and not SocialToken.objects.exists()


@pytest.mark.parametrize("alias", ["steward", "x", "no spaces", "TAKEN"])
def test_an_alias_keeps_the_rules_of_sign_up(client, provider, alias):
    Racer.objects.create_user("taken", "taken@example.org", PASSWORD)
    page = sign_up(client, provider, "mia", alias)
    assert page.status_code == 200 and 'class="errors"' in page.content.decode()
    assert Racer.objects.count() == 1


def test_the_second_log_in_is_the_same_racer_and_goes_on_to_the_page(client, provider):
    sign_up(client, provider, "mia", "speedy")
    client.post("/accounts/logout/")
    assert alias_of(client) == ""
    provider.says("mia", preferred_username="renamed", email="new@example.org")
    assert log_in(client, provider, "mia", next="/races/")["Location"] == "/races/"
    assert alias_of(client) == "speedy" and Racer.objects.count() == 1


def test_the_session_ends_after_the_hours_of_the_setting(client, provider, settings):
    settings.SSO_SESSION_HOURS = 3
    sign_up(client, provider, "mia", "speedy")
    assert client.session.get_expiry_age() == 3 * 3600


def test_an_account_with_the_same_verified_address_is_connected(client, provider):
    own = verified("old-mia", "mia@example.org")
    log_in(client, provider, "mia")
    assert alias_of(client) == "old-mia"
    assert SocialAccount.objects.get().user == own
    own.refresh_from_db()
    assert own.check_password(PASSWORD)


def test_an_address_that_the_provider_has_not_verified_opens_no_account(client, provider):
    verified("victim", "mia@example.org", is_staff=True, is_superuser=True)
    for claim in (False, None, "yes", 1):
        provider.says("mia", email_verified=claim)
        log_in(client, provider, "mia")
        page = client.post("/accounts/3rdparty/signup/", {"username": "attacker", "email": "mia@example.org"})
        assert alias_of(client) == "" and not SocialAccount.objects.exists()
        assert page.status_code == 200 and "exists already" in page.content.decode()


def test_an_account_that_never_verified_the_address_is_not_entered(client, provider):
    """Somebody signed up with the address of another, and waits for them to log in."""
    attacker = Racer.objects.create_user("attacker", "mia@example.org", PASSWORD)
    EmailAddress.objects.create(user=attacker, email="mia@example.org", verified=False, primary=True)
    page = log_in(client, provider, "mia")
    assert page.status_code == 409 and "Another account has the address" in page.content.decode()
    assert alias_of(client) == "" and not SocialAccount.objects.exists()


def test_an_address_given_to_another_person_does_not_open_the_account_of_the_first(client, provider):
    sign_up(client, provider, "mia", "first")
    client.post("/accounts/logout/")
    provider.says("noah", email="mia@example.org")
    assert log_in(client, provider, "noah").status_code == 409
    assert alias_of(client) == "" and SocialAccount.objects.count() == 1


def test_an_unverified_address_is_verified_by_mail(client, provider):
    provider.says("mia", email_verified=False)
    sign_up(client, provider, "mia", "speedy", email="mia@example.org")
    assert not EmailAddress.objects.get().verified
    assert mail.outbox[0].to == ["mia@example.org"]


def test_the_operator_can_vouch_for_the_addresses_of_a_domain(client, provider, settings):
    settings.SSO_VERIFIED_DOMAINS = ("example.org",)
    provider.says("mia", email_verified=None)
    verified("old-mia", "mia@example.org")
    log_in(client, provider, "mia")
    assert alias_of(client) == "old-mia"


def test_a_racer_connects_and_disconnects_their_account(client, provider):
    own = verified("local", "other@example.org")
    client.post("/accounts/login/", {"login": "local", "password": PASSWORD})
    assert "Connect Example University" in client.get("/accounts/3rdparty/").content.decode()
    log_in(client, provider, "mia", process="connect")
    assert not SocialAccount.objects.exists(), "the password once more"
    client.post("/accounts/reauthenticate/", {"password": PASSWORD})
    account = SocialAccount.objects.get()
    assert account.user == own and "Disconnect" in client.get("/accounts/3rdparty/").content.decode()
    client.post("/accounts/3rdparty/", {"account": account.pk})
    assert not SocialAccount.objects.exists()


def test_deactivated_racers_stay_out(client, provider):
    sign_up(client, provider, "mia", "speedy")
    client.post("/accounts/logout/")
    Racer.objects.update(is_active=False)
    assert log_in(client, provider, "mia")["Location"] == "/accounts/inactive/"
    assert alias_of(client) == ""


def test_a_deleted_account_is_not_entered_again(client, provider, now):
    sign_up(client, provider, "mia", "speedy")
    client.post("/accounts/logout/")
    delete_account(racer=Racer.objects.get(), by=None, now=now)
    assert not SocialAccount.objects.exists()
    assert log_in(client, provider, "mia")["Location"] == "/accounts/3rdparty/signup/"
    assert alias_of(client) == ""


def test_the_second_factor_of_the_account_is_still_asked_for(client, provider):
    sign_up(client, provider, "mia", "speedy")
    TOTP.activate(Racer.objects.get(), SECRET)
    client.post("/accounts/logout/")
    assert log_in(client, provider, "mia")["Location"] == "/accounts/2fa/authenticate/"
    assert alias_of(client) == ""
    client.post("/accounts/2fa/authenticate/", {"code": code_of(SECRET)})
    assert alias_of(client) == "speedy"


@pytest.mark.parametrize(("amr", "may"), [(["pwd", "mfa"], True), (["pwd"], False), (None, False)])
def test_an_admins_second_factor_may_be_the_providers(client, provider, settings, amr, may):
    settings.STAFF_SECOND_FACTOR = True
    provider.says("mia", groups=["paddock-admins"], amr=amr)
    sign_up(client, provider, "mia", "speedy")
    assert (client.get("/races/").status_code == 200) is may


def test_groups_give_roles_at_sign_up_and_take_them_at_the_next_log_in(client, provider):
    provider.says("mia", groups=["Paddock-Admins", "writers", "staff", "unknown"])
    sign_up(client, provider, "mia", "speedy")
    racer = Racer.objects.get()
    assert (racer.is_staff, racer.is_superuser) == (True, True)
    assert [group.name for group in racer.groups.all()] == ["Writers"]
    assert SocialAccount.objects.get().extra_data["groups"] == ["Paddock-Admins", "writers", "staff"]
    assert AuditEntry.objects.get().changes == {"roles": ["", "+admin +group:Writers"]}
    client.post("/accounts/logout/")
    racer.groups.add(Group.objects.create(name="By hand"))
    provider.says("mia", groups=["staff"])
    log_in(client, provider, "mia")
    racer.refresh_from_db()
    assert (racer.is_staff, racer.is_superuser) == (False, False)
    assert [group.name for group in racer.groups.all()] == ["By hand"]


def test_sign_up_is_for_the_domains_of_the_setting(client, provider, settings):
    settings.SIGN_UP_DOMAINS = (".example.edu", "example.net")
    page = log_in(client, provider, "mia")
    assert page.status_code == 403 and "example.net" in page.content.decode()
    provider.says("mia", email="mia@cs.example.edu")
    sign_up(client, provider, "mia", "speedy")
    assert alias_of(client) == "speedy"


def test_a_closed_site_takes_nobody_new(client, provider, settings):
    settings.SIGN_UP = "closed"
    assert "does not accept new racers" in log_in(client, provider, "mia").content.decode()
    assert not Racer.objects.exists()


def test_a_site_for_single_sign_on_alone_offers_no_form(client, provider, settings):
    settings.SIGN_UP = "sso"
    page = client.get("/accounts/signup/").content.decode()
    assert "Log in with Example University" in page and 'name="password1"' not in page
    sign_up(client, provider, "mia", "speedy")
    assert alias_of(client) == "speedy"


def test_an_invitation_counts_for_a_racer_of_the_provider(client, provider, settings, now):
    settings.SIGN_UP = "invitation"
    assert "by invitation" in log_in(client, provider, "mia").content.decode()
    later = now.replace(year=now.year + 9)
    invitation = SignUpInvitation.objects.create(expires_at=later, made_at=now)
    client.get(invitation.get_absolute_url())
    sign_up(client, provider, "mia", "speedy")
    invitation.refresh_from_db()
    assert (alias_of(client), invitation.used) == ("speedy", 1)


def test_passwords_are_for_the_racers_of_the_setting_alone(client, provider, settings):
    verified("boss", "boss@example.org")
    verified("other", "other@example.org")
    settings.PASSWORD_RACERS = frozenset({"boss"})
    page = client.get("/accounts/login/").content.decode()
    assert page.index("Log in with Example University") < page.index("<details")
    client.post("/accounts/login/", {"login": "other", "password": PASSWORD})
    assert alias_of(client) == ""
    token = client.post("/api/v1/auth/token/", {"login": "other", "password": PASSWORD}, "application/json")
    assert token.status_code == 400
    client.post("/accounts/password/reset/", {"email": "other@example.org"})
    assert not any("/accounts/password/reset/key/" in message.body for message in mail.outbox)
    client.post("/accounts/signup/", {"username": "new", "email": "n@example.org"})
    assert not Racer.objects.filter(alias="new").exists()
    client.post("/accounts/login/", {"login": "boss", "password": PASSWORD})
    assert alias_of(client) == "boss"


def test_a_racer_without_a_password_gets_one_by_mail(client, provider):
    sign_up(client, provider, "mia", "speedy")
    client.post("/accounts/logout/")
    client.post("/accounts/password/reset/", {"email": "mia@example.org"})
    link = re.findall(r"/accounts/password/reset/key/\S+", mail.outbox[-1].body)[0]
    form = client.get(link, follow=True).request["PATH_INFO"]
    client.post(form, {"password1": PASSWORD, "password2": PASSWORD})
    client.post("/accounts/login/", {"login": "speedy", "password": PASSWORD})
    assert alias_of(client) == "speedy"


def test_a_log_in_that_another_browser_began_is_refused(client, provider):
    page = come_back(client, provider.send(begin(type(client)()), "mia"))
    assert page.status_code == 400 and "started in another browser" in page.content.decode()
