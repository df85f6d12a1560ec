"""Invitations through a mail server that answers: refusals, greylisting, hang-ups, outages, TLS."""

from __future__ import annotations

from datetime import timedelta

import pytest

from league.invitations.services import invite_by_mail, send_invitations
from league.models import MailInvitation
from league.notices.services import send_mails
from races.models import Visibility
from tests.factories import a_race
from tests.mail_server import mail_server

pytestmark = pytest.mark.django_db
ANN, BEN, CAT = "ann@example.org", "ben@example.org", "cat@example.org"
MINUTE = timedelta(minutes=1)


@pytest.fixture
def race(alice, now):
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION, name="밤 경주")
    invite_by_mail(race=race, by=alice, addresses=[ANN, BEN, CAT], language="en", now=now)
    return race


def states(race) -> dict[str, tuple[str, int]]:
    return {one.email: (one.state, one.attempt) for one in MailInvitation.objects.filter(race=race)}


def test_all_go_through_one_connection(race, now):
    with mail_server() as server:
        assert send_invitations(now=now) == 3
    assert server.recipients == [ANN, BEN, CAT]
    assert server.connections == 1
    _to, mail = server.arrived[0]
    assert mail["To"] == ANN
    assert mail["List-Unsubscribe-Post"] == "List-Unsubscribe=One-Click"
    assert "밤 경주" in mail.get_payload(decode=True).decode()


def test_no_connection_is_opened_for_nothing(race, now):
    with mail_server() as server:
        send_invitations(now=now)
        assert send_invitations(now=now + MINUTE) == send_mails(now=now) == 0
    assert server.connections == 1


def test_an_address_that_is_refused_for_good_is_not_tried_again(race, now):
    with mail_server() as server:
        server.answers[BEN] = "550 No such user"
        assert send_invitations(now=now) == 2
        assert states(race)[BEN] == ("failed", 1)
        assert send_invitations(now=now + MINUTE) == 0
    assert server.recipients == [ANN, CAT]


def test_a_mail_that_is_refused_for_good_is_not_tried_again(race, now):
    with mail_server() as server:
        server.answers["DATA"] = "554 Looks like spam"
        assert send_invitations(now=now) == 0
    assert states(race) == dict.fromkeys((ANN, BEN, CAT), ("failed", 1))


def test_greylisting_is_waited_for(race, now):
    """Usual for five minutes and up to some hours."""
    with mail_server() as server:
        server.answers[BEN] = "451 4.7.1 Greylisted, try again later"
        assert send_invitations(now=now) == 2
        at = now
        while at < now + timedelta(hours=1):
            at += MINUTE
            assert send_invitations(now=at) == 0
        assert states(race)[BEN][0] == "due"
        del server.answers[BEN]
        assert send_invitations(now=now + timedelta(hours=2)) == 1
    assert server.recipients == [ANN, CAT, BEN]


def test_what_is_put_off_for_ever_is_given_up(race, now):
    with mail_server() as server:
        server.answers[BEN] = "450 Mailbox busy"
        for hour in range(12):
            send_invitations(now=now + hour * timedelta(hours=5))
    assert states(race)[BEN][0] == "failed"


def test_a_server_that_hangs_up_costs_one_mail_a_try(race, now):
    """Many servers take a few mails of a connection, and then close it."""
    with mail_server() as server:
        server.at_most = 1
        assert send_invitations(now=now) == 2
        assert states(race) == {ANN: ("sent", 1), BEN: ("due", 1), CAT: ("sent", 1)}
        assert send_invitations(now=now + MINUTE) == 1
    assert server.recipients == [ANN, CAT, BEN]


@pytest.mark.parametrize(
    ("answer", "tls"),
    [("421 Not now", False), ("554 You are blocked", False), ("220 mail", True)],
    ids=["busy", "blocked", "no tls"],
)
def test_a_server_that_is_away_costs_no_try(race, now, answer, tls):
    with mail_server(tls=tls) as server:
        server.answers["HELLO"] = answer
        for minute in range(10):
            assert send_invitations(now=now + minute * MINUTE) == 0
            assert send_mails(now=now + minute * MINUTE) == 0
        assert server.recipients == []
    assert states(race) == dict.fromkeys((ANN, BEN, CAT), ("due", 0))
    with mail_server():
        assert send_invitations(now=now + timedelta(hours=1)) == 3


def test_nothing_listens(race, now, settings):
    settings.EMAIL_BACKEND, settings.EMAIL_PORT = "django.core.mail.backends.smtp.EmailBackend", 1
    settings.EMAIL_HOST = "127.0.0.1"
    assert send_invitations(now=now) == 0
    assert states(race) == dict.fromkeys((ANN, BEN, CAT), ("due", 0))
