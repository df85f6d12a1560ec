"""Getting into a race and out of it."""

from __future__ import annotations

from datetime import timedelta

import pytest

from evaluation.models import State
from races.boards.selectors.board import board
from races.entries.services.entries import accept_invitation, enter_race, remove_entry, restore_entry, withdraw
from races.entries.services.submissions import submit_model
from races.models import Entry, Visibility
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.refusals import refused

pytestmark = pytest.mark.django_db


def aliases(race) -> list[str]:
    return [row.alias for row in board(race).rows]


def test_entering_twice_makes_one_entry(alice, now):
    race = a_race(now)
    first = enter_race(race=race, racer=alice, now=now)
    assert enter_race(race=race, racer=alice, now=now + timedelta(hours=1)) == first
    assert Entry.objects.get().entered_at == now


def test_a_race_can_be_entered_until_it_closes(alice, bob, now):
    race = a_race(now, opens_at=now + timedelta(days=1))
    assert enter_race(race=race, racer=alice, now=now)
    refused("race_closed", enter_race, race=race, racer=bob, now=race.closes_at)


def test_a_cancelled_race_cannot_be_entered(alice, now):
    race = a_race(now, cancelled_at=now, cancel_reason="Rain.")
    refused("race_cancelled", enter_race, race=race, racer=alice, now=now)


def test_an_invitation_race_is_entered_only_by_its_link(alice, bob, now):
    race = a_race(now, organiser=bob, visibility=Visibility.INVITATION)
    refused("race_needs_invitation", enter_race, race=race, racer=alice, now=now)
    assert accept_invitation(token=race.invitation, racer=alice, now=now)
    assert enter_race(race=race, racer=bob, now=now), "the organiser needs no link"


def test_a_withdrawn_racer_can_return_with_all_results(alice, bob, now):
    race = a_race(now)
    submission = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    drive(race, bob, laps(9_500, 9_500, 9_500), now)
    withdraw(entry=submission.entry, now=now)
    assert aliases(race) == ["bob"]
    assert board(race).count == 1
    enter_race(race=race, racer=alice, now=now)
    assert aliases(race) == ["alice", "bob"]


def test_a_withdrawn_member_returns_without_an_invitation(alice, bob, now):
    race = a_race(now, organiser=bob, visibility=Visibility.INVITATION)
    withdraw(entry=accept_invitation(token=race.invitation, racer=alice, now=now), now=now)
    assert not enter_race(race=race, racer=alice, now=now).is_withdrawn


def test_withdrawing_stops_the_waiting_car(alice, now, django_capture_on_commit_callbacks):
    race = a_race(now)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    with django_capture_on_commit_callbacks(execute=True):
        withdraw(entry=submission.entry, now=now)
    submission.evaluation.refresh_from_db()
    assert submission.evaluation.state == State.STOPPED
    assert Entry.objects.get().submission_count == 0


def test_a_racer_cannot_withdraw_from_a_finished_race(alice, now):
    race = a_race(now)
    entry = enter_race(race=race, racer=alice, now=now)
    refused("race_closed", withdraw, entry=entry, now=race.closes_at)


def test_a_removed_racer_cannot_come_back(alice, bob, now):
    race = a_race(now, organiser=bob)
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    entry = Entry.objects.get()
    removed = remove_entry(entry=entry, by=bob, now=now, reason=" Not a\nreal car. ")
    assert (removed.removed_at, removed.withdrawn_at, removed.removal_reason) == (now, now, "Not a real car.")
    assert aliases(race) == []
    refused("entry_removed", enter_race, race=race, racer=alice, now=now)
    assert entry.submissions.count() == 1, "what was driven stays to be looked into"


def test_an_invitation_does_not_readmit_a_removed_racer(alice, bob, now):
    race = a_race(now, organiser=bob, visibility=Visibility.INVITATION)
    remove_entry(entry=accept_invitation(token=race.invitation, racer=alice, now=now), by=bob, now=now)
    refused("entry_removed", accept_invitation, token=race.invitation, racer=alice, now=now)


def test_only_the_organiser_and_admins_remove_and_restore(alice, bob, charlie, now):
    race = a_race(now, organiser=bob)
    entry = enter_race(race=race, racer=alice, now=now)
    for nobody in (alice, charlie):
        refused("race_not_yours", remove_entry, entry=entry, by=nobody, now=now)
    admin = a_racer(is_staff=True)
    remove_entry(entry=entry, by=admin, now=now)
    refused("race_not_yours", restore_entry, entry=entry, by=alice)
    assert not restore_entry(entry=entry, by=bob).is_withdrawn
    assert aliases(race) == ["alice"]


def test_a_racer_may_be_removed_after_the_race(alice, bob, now):
    race = a_race(now, organiser=bob)
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    remove_entry(entry=Entry.objects.get(), by=bob, now=race.closes_at + timedelta(days=3))
    assert aliases(race) == []
    race.refresh_from_db()
    assert race.fastest_lap_ms is None
