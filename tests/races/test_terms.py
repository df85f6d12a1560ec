"""Terms of a race: written in versions, accepted before anybody joins, kept with the entry."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse

from races.entries.services.entries import accept_invitation, enter_race, give_field
from races.entries.services.submissions import submit_model
from races.models import Entry, RaceTerms, Submission, TermsAcceptance
from races.pages.services import clone_race, create_community_race, edit_race
from races.test_runs.services import drive_own
from tests.factories import a_model, a_racer, a_track
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def race(alice, now):
    return create_community_race(
        organiser=alice,
        now=now,
        name="Cup",
        track=a_track(),
        opens_at=now,
        closes_at=now + timedelta(days=300),
        prize="A model car",
        sponsor="Wheels Ltd.",
        terms="Be kind.\r\nDrive well. ",
    )


def accepted(race):
    rows = TermsAcceptance.objects.filter(entry__race=race).order_by("pk")
    return [(row.entry.racer.alias, row.terms.version, row.accepted_at) for row in rows]


def test_terms_are_kept_with_the_entry_in_their_version_and_time(race, bob, now):
    enter_race(race=race, racer=bob, now=now, terms=1)
    assert accepted(race) == [("bob", 1, now)]
    assert RaceTerms.objects.get(race=race).text == "Be kind.\nDrive well."


@pytest.mark.parametrize("terms", [None, 0, 2])
def test_nobody_joins_without_accepting_the_terms_that_stand(race, bob, now, terms):
    fault = refused("race_terms", enter_race, race=race, racer=bob, now=now, terms=terms)
    assert fault.params == {"version": 1}
    refused("race_terms", submit_model, race=race, racer=bob, model=a_model(bob), now=now, terms=terms)
    assert not Entry.objects.exists() and not Submission.objects.exists()


def test_a_car_may_be_sent_with_the_acceptance(race, bob, now):
    submit_model(race=race, racer=bob, model=a_model(bob), now=now, terms=1)
    assert accepted(race) == [("bob", 1, now)]
    submit = {"race": race, "racer": bob, "model": a_model(bob), "now": now}
    refused("submission_running", submit_model, **submit)  # nobody asks for the terms again


def test_changed_terms_are_accepted_anew_before_the_next_car(race, alice, bob, now):
    enter_race(race=race, racer=bob, now=now, terms=1)
    later = now + timedelta(hours=1)
    edit_race(race=race, now=later, terms="Be kind.\nDrive slowly.")
    assert race.terms_version == 2
    refused("race_terms", submit_model, race=race, racer=bob, model=a_model(bob), now=later)
    enter_race(race=race, racer=bob, now=later, terms=2)
    submit_model(race=race, racer=bob, model=a_model(bob), now=later)
    assert accepted(race) == [("bob", 1, now), ("bob", 2, later)]
    assert [one.text[9:] for one in RaceTerms.objects.order_by("version")] == ["Drive well.", "Drive slowly."]


@pytest.mark.parametrize("terms", ["Be kind.\nDrive well.", "  Be kind.\r\nDrive well.\r\n"])
def test_the_same_words_are_no_other_version(race, now, terms):
    edit_race(race=race, now=now, terms=terms)
    assert (race.terms_version, RaceTerms.objects.count()) == (1, 1)


def test_terms_that_are_taken_away_ask_nobody_any_more(race, bob, now):
    edit_race(race=race, now=now, terms="")
    enter_race(race=race, racer=bob, now=now)
    assert race.terms_version == 0 and not accepted(race)


def test_house_cars_accept_nothing(race, now):
    house = a_racer("house", is_house=True)
    submit_model(race=race, racer=house, model=a_model(house), now=now)
    assert not accepted(race)


def test_whoever_was_given_a_place_accepts_with_the_first_car(race, bob, now):
    give_field(race=race, racers=[bob.pk], now=now, reason="finale")
    refused("race_terms", submit_model, race=race, racer=bob, model=a_model(bob), now=now)
    submit_model(race=race, racer=bob, model=a_model(bob), now=now, terms=1)


def test_an_invitation_asks_for_the_terms(race, bob, now):
    edit_race(race=race, now=now, visibility="invitation")
    refused("race_terms", accept_invitation, token=race.invitation, racer=bob, now=now)
    assert accept_invitation(token=race.invitation, racer=bob, now=now, terms=1).race == race


def test_what_is_sent_later_needs_them_accepted_before(race, bob, now):
    model = a_model(bob)
    refused("race_terms", drive_own, owner=bob, model=model, race=race, submit_if_better=True, now=now)
    enter_race(race=race, racer=bob, now=now, terms=1)
    assert drive_own(owner=bob, model=model, race=race, submit_if_better=True, now=now).race == race


def test_a_cloned_race_has_the_same_terms_as_its_own_first_version(race, now):
    clone = clone_race(race=race, now=now)
    assert (clone.prize, clone.sponsor, clone.terms_version) == ("A model car", "Wheels Ltd.", 1)
    assert RaceTerms.objects.get(race=clone).text == race.terms


def test_a_race_is_deleted_with_its_terms_and_who_accepted_them(race, bob, now):
    enter_race(race=race, racer=bob, now=now, terms=1)
    race.delete()
    assert not RaceTerms.objects.exists() and not TermsAcceptance.objects.exists()


# --- pages and API ----------------------------------------------------------------------------------------------------


def test_the_card_of_an_open_race_names_prize_sponsor_and_terms(race, client):
    card = client.get("/races/").content.decode()
    assert "A model car" in card and "Wheels Ltd." in card and "terms to accept" in card


def test_the_page_asks_once_and_keeps_the_tick(race, bob, client):
    client.force_login(bob)
    model = a_model(bob)
    page = client.get(race.get_absolute_url()).content.decode()
    assert 'name="terms" value="1" required' in page and "A model car" in page and "Wheels Ltd." in page
    address = reverse("submit", args=[race.slug])
    refusal = client.post(address, {"model": model.public_id, "from": "model"}, follow=True)
    assert refusal.redirect_chain[0][0] == f"{race.get_absolute_url()}#send"
    assert not Submission.objects.exists()
    client.post(address, {"model": model.public_id, "terms": "1"})
    assert Submission.objects.exists()
    assert 'name="terms"' not in client.get(race.get_absolute_url()).content.decode()
    assert "Be kind." in client.get(reverse("race_rules", args=[race.slug])).content.decode()


def test_the_organiser_sees_who_accepted_what(race, alice, bob, now, client):
    enter_race(race=race, racer=bob, now=now, terms=1)
    client.force_login(alice)
    assert "version 1" in client.get(reverse("race_racers", args=[race.slug])).content.decode()


def test_a_guest_ticks_the_box_of_an_invitation_before_the_log_in(race, bob, now, client):
    edit_race(race=race, now=now, visibility="invitation")
    address = reverse("race_invitation", args=[race.invitation])
    assert "Be kind." in client.get(address).content.decode()
    client.post(address, {"with": "login", "terms": "1"})
    kept = dict(client.session)
    client.force_login(bob)
    session = client.session
    session.update({key: value for key, value in kept.items() if not key.startswith("_")})
    session.save()
    assert client.get(address).url == race.get_absolute_url()
    assert [row[:2] for row in accepted(race)] == [("bob", 1)]


def test_a_guest_who_did_not_tick_it_is_asked_again_after_the_log_in(race, bob, now, client):
    edit_race(race=race, now=now, visibility="invitation")
    address = reverse("race_invitation", args=[race.invitation])
    client.force_login(bob)
    session = client.session
    session["accepted_invitation"] = {"token": race.invitation, "terms": None}
    session.save()
    assert 'name="terms"' in client.get(address).content.decode()
    assert not Entry.objects.exists()
