"""Invitations to a race by e-mail: lists, mails, links, limits, and what nobody learns."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core import mail
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone

from accounts.models import RacerQuota
from league.invitations import services as inviting
from league.invitations.services import (
    accept_mail_invitation,
    addresses_of,
    invitation_of,
    invite_again,
    invite_by_mail,
    link_token,
    read_addresses,
    send_invitations,
    stop_invitations,
    withdraw_invitation,
)
from league.models import MailInvitation
from paddock.errors import UserFault
from races.entries.selectors.visibility import can_see_race
from races.models import Entry, Visibility
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db
LATER = timedelta(days=1, minutes=1)


def invited(race, by, now, *addresses: str) -> list[MailInvitation]:
    invite_by_mail(race=race, by=by, addresses=addresses or ["ann@example.org"], language="en", now=now)
    return list(MailInvitation.objects.filter(race=race))


@pytest.fixture
def race(alice, now):
    return a_race(now, organiser=alice, visibility=Visibility.INVITATION, name="Night race")


def code(call) -> str:
    with pytest.raises(UserFault) as refused:
        call()
    return refused.value.code


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a@example.org", ["a@example.org"]),
        ("Name,E-mail\nAnn Lee,Ann@Example.org\n\n김,kim@example.org\n", ["ann@example.org", "kim@example.org"]),
        ("Ann <a@example.org>; b@example.org\ta@example.org", ["a@example.org", "b@example.org"]),
    ],
)
def test_a_list_is_read(text, found):
    lines = read_addresses({"Addresses": text})
    assert addresses_of(lines) == found and not any(line.is_wrong for line in lines)


@pytest.mark.parametrize(
    ("text", "wrong", "found"),
    [
        ("a@example.org\nnobody", [2], ["a@example.org"]),
        ("a@b\n\nc@example.org", [1], ["c@example.org"]),
        ("a@example.org\nb@exa mple", [2], ["a@example.org"]),
        ("mail\na@example.org\nx@@y, b@example.org\n---", [3, 4], ["a@example.org", "b@example.org"]),
        (f"a@example.org\n{'x' * 250}@example.org", [2], ["a@example.org"]),
    ],
)
def test_wrong_lines_are_marked_and_the_rest_is_read(text, wrong, found):
    lines = read_addresses({"CSV file": text})
    assert [line.number for line in lines if line.is_wrong] == wrong
    assert {line.source for line in lines} == {"CSV file"}
    assert addresses_of(lines) == found


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "invited_none"),
        ("nobody\na@b", "invited_none"),
        ("\n".join(f"r{n}@example.org" for n in range(501)), "invited_too_many"),
    ],
)
def test_what_is_no_list_is_refused(text, why):
    assert code(lambda: addresses_of(read_addresses({"Addresses": text}))) == why


def test_an_invitation_goes_out_once_and_joins_one_racer(race, alice, bob, charlie, now):
    (one,) = invited(race, alice, now)
    assert send_invitations(now=now) == 1 and send_invitations(now=now) == 0
    (sent,) = mail.outbox
    assert sent.to == ["ann@example.org"] and "alice invites you to the race Night race" in sent.subject
    token = link_token(one)
    assert f"/races/invited/{token}/" in sent.body and "List-Unsubscribe" in sent.extra_headers
    assert not can_see_race(bob, race)
    entry = accept_mail_invitation(token=token, racer=bob, now=now)
    assert entry.racer == bob and can_see_race(bob, race)
    one.refresh_from_db()
    assert (one.standing_at(now), one.accepted_by) == ("accepted", bob)
    assert code(lambda: accept_mail_invitation(token=token, racer=charlie, now=now)) == "invitation_unknown"
    assert code(lambda: invite_again(invitation=one, by=alice, now=now + LATER)) == "invitation_taken"
    assert code(lambda: withdraw_invitation(invitation=one, by=alice, now=now)) == "invitation_taken"
    assert not Entry.objects.filter(racer=charlie).exists()


def test_a_link_ends_by_time_by_withdrawing_and_by_another(race, alice, bob, now):
    (one,) = invited(race, alice, now)
    send_invitations(now=now)
    first = link_token(one)
    assert invitation_of(first, now) == one
    assert invitation_of(first, one.expires_at) is None and one.expires_at <= race.closes_at
    for wrong in ("", "x", first[:-1], first.replace(":", ";")):
        assert invitation_of(wrong, now) is None
    assert code(lambda: invite_again(invitation=one, by=alice, now=now)) == "invitation_too_soon"
    withdraw_invitation(invitation=one, by=alice, now=now)
    assert invitation_of(first, now) is None
    assert code(lambda: accept_mail_invitation(token=first, racer=bob, now=now)) == "invitation_unknown"
    again = invite_again(invitation=one, by=alice, now=now + LATER)
    assert send_invitations(now=now + LATER) == 1 and len(mail.outbox) == 2
    assert invitation_of(first, now + LATER) is None
    assert invitation_of(link_token(again), now + LATER) == one


def test_a_withdrawn_one_that_waits_is_not_sent(race, alice, now):
    (one,) = invited(race, alice, now)
    withdraw_invitation(invitation=one, by=alice, now=now)
    assert send_invitations(now=now) == 0 and not mail.outbox


def test_only_an_organiser_of_a_race_that_is_on_invites(race, alice, bob, now):
    ask = {"addresses": ["a@example.org"], "language": "en"}
    assert code(lambda: invite_by_mail(race=race, by=bob, now=now, **ask)) == "race_not_yours"
    assert code(lambda: invite_by_mail(race=race, by=alice, now=race.closes_at, **ask)) == "race_closed"
    (one,) = invited(race, alice, now)
    assert code(lambda: invite_again(invitation=one, by=bob, now=now)) == "race_not_yours"
    assert code(lambda: withdraw_invitation(invitation=one, by=bob, now=now)) == "race_not_yours"


def test_the_quota_of_a_day_holds_and_nobody_is_invited_beyond_it(race, alice, now):
    RacerQuota.objects.create(racer=alice, name="invited_a_day", limit=2)
    invited(race, alice, now, "a@example.org")
    ask = {"race": race, "by": alice, "language": "en"}
    two = ["b@example.org", "c@example.org"]
    assert code(lambda: invite_by_mail(addresses=two, now=now, **ask)) == "invitations_a_day"
    assert MailInvitation.objects.count() == 1
    assert invite_by_mail(addresses=["a@example.org", "b@example.org"], now=now, **ask) == 1, "known ones cost nothing"
    assert invite_by_mail(addresses=two, now=now + LATER, **ask) == 1


def test_nobody_learns_whose_an_address_is_or_that_it_wants_no_invitations(race, alice, bob, now):
    stop_invitations(email="stop@example.org", now=now)
    rows = invited(race, alice, now, bob.email, "unknown@example.org", "stop@example.org")
    assert send_invitations(now=now) == 2
    assert {to for one in mail.outbox for to in one.to} == {bob.email, "unknown@example.org"}
    bodies = [one.body.splitlines()[0] for one in mail.outbox]
    assert bodies[0] == bodies[1]
    for one in rows:
        one.refresh_from_db()
    assert {one.standing_at(now) for one in rows} == {"invited"}


def test_one_address_is_not_flooded_by_many(now):
    for number in range(inviting.TO_ONE_ADDRESS + 1):
        by = a_racer()
        invited(a_race(now, organiser=by, slug=f"flood-{number}"), by, now)
        send_invitations(now=now)
    assert len(mail.outbox) == inviting.TO_ONE_ADDRESS


def test_a_mail_server_that_refuses_is_tried_three_times(race, alice, now, monkeypatch):
    (one,) = invited(race, alice, now)
    monkeypatch.setattr(inviting.EmailMessage, "send", lambda self: (_ for _ in ()).throw(OSError("away")))
    for number in range(4):
        assert send_invitations(now=now + timedelta(hours=number)) == 0
    one.refresh_from_db()
    assert (one.state, one.attempt, one.standing_at(now)) == ("failed", 3, "invited")


def test_the_pages(alice, bob, charlie):
    now = timezone.now()
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    address = f"/races/{race.slug}/invited/"
    organiser, guest, stranger = Client(), Client(), Client()
    organiser.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    stranger.force_login(charlie, backend="django.contrib.auth.backends.ModelBackend")
    assert stranger.get(address).status_code == 404
    file = SimpleUploadedFile("class.csv", b"name,mail\nKim,kim@example.org\n", content_type="text/csv")
    page = organiser.post(address, {"invite": "1", "addresses": "ann@example.org", "file": file}, follow=True)
    assert "2 addresses are invited." in page.content.decode()
    wrong = organiser.post(address, {"invite": "1", "addresses": "ann@example.org\nxx"})
    assert wrong.status_code == 422 and "line 2" in wrong.content.decode()
    binary = SimpleUploadedFile("x.csv", b"\xff\xfe\x00")
    assert "UTF-8" in organiser.post(address, {"invite": "1", "file": binary}).content.decode()
    one, two = MailInvitation.objects.filter(race=race)
    assert stranger.post(address, {"withdraw": two.pk}).status_code == 404
    assert "withdrawn" in organiser.post(address, {"withdraw": two.pk}, follow=True).content.decode()
    assert organiser.post(address, {"again": "x"}).status_code == 404
    link = f"/races/invited/{link_token(one)}/"
    assert race.name in guest.get(link).content.decode()
    sent = guest.post(link, headers={"Referer": f"http://testserver{link}"})
    assert sent["Location"].startswith("/accounts/login/?next=/races/invited/")
    assert guest.get(f"/races/invited/{link_token(two)}/").status_code == 404
    guest.force_login(bob, backend="django.contrib.auth.backends.ModelBackend")
    assert "You have joined." in guest.post(link, follow=True).content.decode()
    assert "accepted" in organiser.get(address).content.decode()
    stop = f"/invitations/stop/{inviting.stop_token('kim@example.org')}/"
    assert "No more invitations?" in Client(enforce_csrf_checks=True).get(stop).content.decode()
    assert "will receive no more invitations" in Client(enforce_csrf_checks=True).post(stop).content.decode()
    assert Client().get("/invitations/stop/x/").status_code == 404


@pytest.fixture
def page(alice):
    race = a_race(timezone.now(), organiser=alice, visibility=Visibility.INVITATION)
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    return client, f"/races/{race.slug}/invited/"


def test_a_preview_marks_wrong_lines_by_field_and_sends_nothing(page):
    client, address = page
    file = SimpleUploadedFile("class.csv", b"name,mail\nKim,kim@example.org\nLee,lee(at)example.org\n")
    sent = {"look": "1", "addresses": "ann@example.org\nbob@@example.org", "file": file}
    answer = client.post(address, sent)
    text = answer.content.decode()
    assert answer.status_code == 200 and not MailInvitation.objects.exists()
    assert "Addresses, line 2" in text and "CSV file, line 3" in text and "2 wrong lines" in text
    assert text.count('class="wrong-line"') == 2
    rest = answer.context["addresses"]
    assert rest == ["ann@example.org", "kim@example.org"]
    assert "Invite 2 addresses" in text
    client.post(address, {"invite": "1", "addresses": " ".join(rest)})
    assert sorted(MailInvitation.objects.values_list("email", flat=True)) == rest


def test_wrong_lines_do_not_keep_the_rest_from_being_invited(page):
    client, address = page
    answer = client.post(address, {"invite": "1", "addresses": "ann@example.org\nxx\nkim@example.org"})
    text = answer.content.decode()
    assert answer.status_code == 422 and "2 addresses are invited." in text
    assert "Addresses, line 2" in text and answer.context["form"]["addresses"].value() == "xx"
    assert MailInvitation.objects.count() == 2


def test_a_site_without_a_mail_server_says_that_mails_go_to_files(page, settings):
    client, address = page
    settings.EMAIL_BACKEND = "core.mail.FolderBackend"
    assert "no mail server" in client.get(address).content.decode()
    text = client.post(address, {"invite": "1", "addresses": "ann@example.org"}, follow=True).content.decode()
    assert "written to a file only" in text and "address is invited" not in text
    for other in ("/accounts/password/reset/", "/settings/notices/", "/accounts/email/", "/accounts/confirm-email/"):
        answer = (Client() if "reset" in other else client).get(other)
        assert answer.status_code == 200 and "no mail server" in answer.content.decode(), other
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    assert "no mail server" not in client.get(address).content.decode()
