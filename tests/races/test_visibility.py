"""Who sees what: each predicate and its queryset twin say the same for the whole cast."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser

from evaluation.models import Evaluation
from races.entries.selectors.visibility import (
    can_organise,
    can_see_evaluation,
    can_see_race,
    evaluations_visible_to,
    races_visible_to,
)
from races.entries.services.entries import accept_invitation, remove_entry, withdraw
from races.entries.services.submissions import submit_model
from races.models import Entry, Race, RaceKind, Visibility
from tests.factories import a_model, a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def cast(now):
    """Alice organises, Bob is in, Charlie is a stranger, Dora was removed, Erin withdrew, Stella is an admin."""
    racers = {name: a_racer(name) for name in ("alice", "bob", "charlie", "dora", "erin")}
    return racers | {"stella": a_racer("stella", is_staff=True), "anonymous": AnonymousUser(), "nobody": None}


@pytest.fixture
def races(cast, now):
    secret = a_race(now, organiser=cast["alice"], visibility=Visibility.INVITATION, slug="secret")
    public = a_race(now, organiser=cast["alice"], slug="public")
    league = a_race(now, kind=RaceKind.LEAGUE, division="open", slug="league")
    cancelled = a_race(now, cancelled_at=now, cancel_reason="Rain.", slug="cancelled")
    upcoming = a_race(now, opens_at=now + timedelta(days=1), slug="upcoming")
    for race in (secret, public):
        for name in ("bob", "dora", "erin"):
            accept_or_enter(race, cast[name], now)
        remove_entry(entry=Entry.objects.get(race=race, racer=cast["dora"]), by=cast["alice"], now=now)
        withdraw(entry=Entry.objects.get(race=race, racer=cast["erin"]), now=now)
    return {race.slug: race for race in (secret, public, league, cancelled, upcoming)}


def accept_or_enter(race, racer, now) -> Entry:
    if race.visibility == Visibility.INVITATION:
        return accept_invitation(token=race.invitation, racer=racer, now=now)
    return Entry.objects.create(race=race, racer=racer, entered_at=now)


def test_everybody_sees_public_races_and_members_private_ones(cast, races):
    public = {"public", "league", "cancelled", "upcoming"}
    insiders = ("alice", "bob", "erin", "stella")
    for name, racer in cast.items():
        expected = public | {"secret"} if name in insiders else public
        assert {race.slug for race in races_visible_to(racer)} == expected, name
        assert {slug for slug, race in races.items() if can_see_race(racer, race)} == expected, name


def test_a_race_is_listed_once_however_many_racers_it_has(cast, races):
    assert races_visible_to(cast["bob"]).count() == Race.objects.count()


def test_only_organisers_and_admins_manage_a_race(cast, races):
    expected = {
        "alice": {"secret", "public"},
        "stella": set(races),
    }
    for name, racer in cast.items():
        found = {slug for slug, race in races.items() if can_organise(racer, race)}
        assert found == expected.get(name, set()), name


def test_runs_on_a_board_are_visible_with_the_board(cast, races, now):
    bob, runs = cast["bob"], {}
    for slug in ("secret", "public"):
        race = races[slug]
        runs[f"{slug} best"] = drive(race, bob, laps(9_000, 9_000, 9_000), now).evaluation
        runs[f"{slug} worse"] = drive(race, bob, laps(9_500, 9_500, 9_500), now).evaluation
        runs[f"{slug} waiting"] = submit_model(race=race, racer=bob, model=a_model(bob), now=now).evaluation
    from evaluation.running.queue.services import queue_evaluation
    from paddock.rules.race import RaceRules

    runs["test drive"] = queue_evaluation(
        owner=bob, model=a_model(bob), track=races["public"].track, rules=RaceRules(), now=now
    )
    everything = set(runs)
    expected = {
        "bob": everything,
        "stella": everything,
        "alice": everything - {"test drive"},
        "erin": {"secret best", "public best"},
    }
    for name, racer in cast.items():
        seen = {key for key, evaluation in runs.items() if can_see_evaluation(racer, evaluation)}
        assert seen == expected.get(name, {"public best"}), name
        visible = set(evaluations_visible_to(racer).values_list("pk", flat=True))
        assert visible == {runs[key].pk for key in seen}, name


def test_leaving_the_board_hides_the_run(cast, races, now):
    submission = drive(races["public"], cast["charlie"], laps(9_000, 9_000, 9_000), now)
    evaluation = Evaluation.objects.get(pk=submission.evaluation_id)
    assert can_see_evaluation(None, evaluation)
    withdraw(entry=submission.entry, now=now)
    for name in ("anonymous", "bob"):
        assert not can_see_evaluation(cast[name], evaluation)
        assert evaluation not in evaluations_visible_to(cast[name])
    assert can_see_evaluation(cast["charlie"], evaluation)


def test_duels_are_visible_with_their_race(cast, now):
    from races.duels.services import draw_duels, drive_on
    from tests.duels import a_duel_race, driving, qualify

    for visibility in Visibility.values:
        race = a_duel_race(now, organiser=cast["alice"], visibility=visibility)
        for name in ("bob", "dora", "erin"):
            accept_or_enter(race, cast[name], now)
        qualify(race, [cast["bob"], cast["erin"], cast["dora"]], now)
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
        remove_entry(entry=Entry.objects.get(race=race, racer=cast["dora"]), by=cast["alice"], now=now)
        (duel,) = driving(race)
        evaluation = duel.evaluation
        for name, racer in cast.items():
            expected = can_see_race(racer, race) or (racer is not None and racer.pk == evaluation.owner_id)
            assert can_see_evaluation(racer, evaluation) == expected, (visibility, name)
            assert evaluations_visible_to(racer).filter(pk=evaluation.pk).exists() == expected, (visibility, name)
        assert can_see_evaluation(cast["charlie"], evaluation) == (visibility == Visibility.PUBLIC)
