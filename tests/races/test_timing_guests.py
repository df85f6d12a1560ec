"""Guests race without an account, and their laps become a racer's when somebody takes them over."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest
from django.db import IntegrityError
from django.utils import timezone

from accounts.models import Racer
from races.boards.selectors.board import board
from races.models import Entry, Guest, TimedSession
from races.timing.services import carry_over, claim_guest, link_guest
from tests.factories import a_racer
from tests.races.test_timing import refused
from tests.races.timing import a_physical_race, a_session, standing, timed

pytestmark = pytest.mark.django_db


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser)


def a_guest(race, organiser, now, *times, id=None, name="김철수"):
    id = id or uuid.uuid4()
    carry_over(race=race, by=organiser, sent=a_session(now, *times, guest=(id, name)), now=now)
    return Guest.objects.get(pk=id)


def test_a_guest_stands_on_the_board_by_the_typed_name_and_cannot_log_in(race, organiser, now):
    guest = a_guest(race, organiser, now, 10_000)
    a_guest(race, organiser, now, 9_000, id=guest.pk)
    assert [(row.alias, row.rank, row.entry.score_ms) for row in board(race).rows] == [("김철수", 1, 9_000)]
    racer = guest.entry.racer
    assert not racer.is_active and not racer.has_usable_password() and not racer.check_password("!")
    with pytest.raises(IntegrityError):
        Racer.objects.filter(pk=racer.pk).update(is_active=True)


def test_a_linked_guests_laps_are_the_racers(race, organiser, now):
    alice = a_racer("alice")
    timed(race, alice, organiser, now, 11_000)
    guest = a_guest(race, organiser, now, 10_000)
    link_guest(guest=guest, racer=alice, by=organiser, now=now)
    assert [(row.alias, row.entry.score_ms) for row in board(race).rows] == [("alice", 10_000)]
    entry = Entry.objects.get()
    assert (entry.submission_count, entry.last_number, entry.guest_name) == (2, 2, "")
    assert not Racer.objects.filter(alias__startswith="guest-").exists()
    # what the device sends later of the same guest is the racer's as well
    carry_over(race=race, by=organiser, sent=a_session(now, 8_000, guest=(guest.pk, "김철수")), now=now)
    assert standing(race, alice)[1] == 8_000


def test_a_guest_claims_their_laps_once_with_the_secret(race, organiser, now):
    guest, alice, bob = a_guest(race, organiser, now, 10_000), a_racer("alice"), a_racer("bob")
    refused("guest_unknown", lambda: claim_guest(claim="", racer=alice, now=now))
    refused("guest_unknown", lambda: claim_guest(claim="x" * 24, racer=alice, now=now))
    claim_guest(claim=guest.claim, racer=alice, now=now)
    assert standing(race, alice)[1] == 10_000
    with pytest.raises(Exception) as caught:
        claim_guest(claim=guest.claim, racer=bob, now=now)
    assert caught.value.code == "guest_linked"
    assert TimedSession.objects.get().entry.racer == alice


def test_only_the_organiser_links(race, organiser, now):
    guest, alice = a_guest(race, organiser, now, 10_000), a_racer("alice")
    refused("race_not_yours", lambda: link_guest(guest=guest, racer=alice, by=alice, now=now))
    link_guest(guest=guest, racer=alice, by=organiser, now=race.closes_at + timedelta(days=1))
    assert standing(race, alice)[1] == 10_000


def test_a_guest_is_not_linked_to_another_guest(race, organiser, now):
    first, second = a_guest(race, organiser, now, 10_000), a_guest(race, organiser, now, 9_000)
    refused("timing_racer_unknown", lambda: link_guest(guest=first, racer=second.entry.racer, by=organiser, now=now))


def test_an_id_of_another_races_guest_is_refused(race, organiser, now):
    guest = a_guest(race, organiser, now, 10_000)
    other = a_physical_race(now, organiser=organiser)
    sent = a_session(now, 10_000, guest=(guest.pk, "x"))
    refused("timing_id_taken", lambda: carry_over(race=other, by=organiser, sent=sent, now=now))


def test_a_guest_is_shown_by_name_everywhere_and_has_no_page(organiser, client):
    now = timezone.now()
    race = a_physical_race(now, organiser=organiser)
    guest, alice = a_guest(race, organiser, now, 10_000, name="Mia Guest"), a_racer("alice")
    timed(race, alice, organiser, now, 11_000)
    stand_in = guest.entry.racer.alias
    page = f"/racers/{stand_in}/"
    assert client.get(page).status_code == 404
    client.force_login(organiser)
    pages = ["/", "/races/", *(f"/races/{race.slug}/{name}" for name in ("", "laps/", "racers/", "timing/set-up/"))]
    for address in pages:
        said = client.get(address)
        text = said.content.decode()
        assert said.status_code == 200 and f'"{page}' not in text, address
        assert "Mia Guest" in text or address == "/races/", address
    assert f"/racers/{alice.alias}/" in client.get(f"/races/{race.slug}/").content.decode()
    for name in ("board.json", "board.csv", "board.atom", "badge.svg"):
        feed = client.get(f"/races/{race.slug}/{name}").content.decode()
        assert "Mia Guest" in feed and stand_in not in feed, name
    remove = client.get(f"/races/{race.slug}/racers/{stand_in}/remove/").content.decode()
    assert "Remove Mia Guest?" in remove
