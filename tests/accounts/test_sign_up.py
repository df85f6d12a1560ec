"""Who may sign up: everybody, who was invited, or nobody."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from accounts.models import Racer, SignUpInvitation
from accounts.signing_in.services import take_up_invitation
from paddock.errors import UserFault
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db
PASSWORD = "a long enough passphrase"


def form_of(alias: str) -> dict[str, str]:
    return {"username": alias, "email": f"{alias}@example.org", "password1": PASSWORD, "password2": PASSWORD}


def an_invitation(**fields) -> SignUpInvitation:
    now = timezone.now()
    return SignUpInvitation.objects.create(**({"made_at": now, "expires_at": now + timedelta(days=1)} | fields))


def aliases() -> list[str]:
    return list(Racer.objects.order_by("alias").values_list("alias", flat=True))


def test_closed_sign_up_is_refused_and_not_offered(client, settings) -> None:
    settings.SIGN_UP = "closed"
    client.get(an_invitation().get_absolute_url())
    page = client.post("/accounts/signup/", form_of("alice"))
    assert "does not accept new racers" in page.content.decode()
    assert aliases() == []
    race = a_race(timezone.now())
    for path in ("/", "/races/", race.get_absolute_url(), "/accounts/login/"):
        assert reverse("account_signup") not in client.get(path).content.decode()


def test_the_page_explains_how_to_get_an_invitation(client, settings) -> None:
    settings.SIGN_UP = "invitation"
    page = client.post("/accounts/signup/", form_of("alice")).content.decode()
    assert "Sign-up is by invitation" in page
    assert aliases() == []


def test_an_invitation_link_works_for_its_number_of_racers(client, settings) -> None:
    settings.SIGN_UP = "invitation"
    invitation = an_invitation(uses=2)
    for alias in ("alice", "bob", "carol"):
        client.get(invitation.get_absolute_url(), follow=True)
        client.post("/accounts/signup/", form_of(alias))
        client.logout()
    assert aliases() == ["alice", "bob"]
    invitation.refresh_from_db()
    assert invitation.used == 2
    over = client.get(invitation.get_absolute_url())
    assert over.status_code == 404 and "Ask the sender" in over.content.decode()


def test_a_refused_form_does_not_use_up_the_invitation(client, settings) -> None:
    settings.SIGN_UP = "invitation"
    invitation = an_invitation()
    client.get(invitation.get_absolute_url())
    client.post("/accounts/signup/", form_of("alice") | {"password2": "another"})
    invitation.refresh_from_db()
    assert (aliases(), invitation.used) == ([], 0)
    client.post("/accounts/signup/", form_of("alice"))
    assert aliases() == ["alice"]


def test_one_visit_to_an_invitation_signs_up_one_racer(client, settings) -> None:
    settings.SIGN_UP = "invitation"
    client.get(an_invitation(uses=5).get_absolute_url())
    client.post("/accounts/signup/", form_of("alice"))
    client.post("/accounts/logout/")
    assert "by invitation" in client.post("/accounts/signup/", form_of("bob")).content.decode()


@pytest.mark.parametrize("fields", [{"used": 1}, {"expires_at": timezone.now() - timedelta(days=1)}])
def test_a_used_or_expired_invitation_does_not_work(client, settings, fields) -> None:
    settings.SIGN_UP = "invitation"
    invitation = an_invitation(**fields)
    assert client.get(invitation.get_absolute_url()).status_code == 404
    with pytest.raises(UserFault, match="Ask the sender"):
        take_up_invitation(code=invitation.code, now=timezone.now())


def test_losing_the_last_place_is_a_form_error(client, settings, monkeypatch) -> None:
    settings.SIGN_UP = "invitation"
    invitation = an_invitation()
    client.get(invitation.get_absolute_url())
    monkeypatch.setattr("accounts.signing_in.services.open_invitation", lambda code, now: invitation)
    SignUpInvitation.objects.update(used=1)
    page = client.post("/accounts/signup/", form_of("alice"))
    assert "is used up" in page.content.decode()
    assert aliases() == [], "neither the racer nor the use"


def test_an_open_site_needs_no_invitation(client, settings) -> None:
    settings.SIGN_UP = "open"
    assert client.get("/join/anything/")["Location"] == reverse("account_signup")
    client.post("/accounts/signup/", form_of("alice"))
    assert aliases() == ["alice"]


def test_a_racer_following_an_invitation_lands_on_the_home_page(client, settings) -> None:
    settings.SIGN_UP = "invitation"
    client.force_login(a_racer("alice"), backend="django.contrib.auth.backends.ModelBackend")
    assert client.get(an_invitation().get_absolute_url())["Location"] == "/"


def test_an_admin_creates_an_invitation_and_sees_its_link(client, settings) -> None:
    boss = Racer.objects.create_superuser("boss", "boss@example.org", None)
    client.force_login(boss)
    later = timezone.localtime(timezone.now() + timedelta(days=3))
    form = {"note": "Class 3b", "uses": "40"}
    form |= {"expires_at_0": later.date().isoformat(), "expires_at_1": later.strftime("%H:%M:%S")}
    assert client.post(reverse("admin:accounts_signupinvitation_add"), form).status_code == 302
    invitation = SignUpInvitation.objects.get()
    assert (invitation.note, invitation.uses, invitation.made_by) == ("Class 3b", 40, boss)
    listed = client.get(reverse("admin:accounts_signupinvitation_changelist")).content.decode()
    assert settings.SITE_URL + invitation.get_absolute_url() in listed
