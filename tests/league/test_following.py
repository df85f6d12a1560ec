"""What followers see and are told, the pages, and the notice of an invitation to a team."""

from __future__ import annotations

from datetime import timedelta
from unittest.mock import patch

import pytest
from django.test import Client
from django.utils import timezone

from accounts.following import follow_racer, followed_by
from accounts.models import Racer, TeamInvitation
from accounts.teams.services import found_team, invite_to_team
from core.events import record
from league.events import CUP_OVER, PROMOTED
from league.following.selectors import Doing, doings_of_followed
from league.models import Cup, CupPlace, Mail, Notice, NoticeChoice
from league.notices.sentences import sentence
from league.stewarding.official_results import close_round
from races.entries.services.entries import withdraw
from races.events import RACE_OFFICIAL
from races.models import Visibility
from tests.factories import a_race, a_racer, drive, laps
from tests.happened import tell_what_happened
from tests.kept_parts import parts_are_kept
from tests.league.seasons import a_round, a_season, after, board, racers
from tests.pages.test_queries import queries

pytestmark = pytest.mark.django_db
BACKEND = "django.contrib.auth.backends.ModelBackend"


def told(racer: Racer, kind: str = "followed") -> list[str]:
    return [sentence(one) for one in Notice.objects.filter(racer=racer, kind=kind).order_by("pk")]


def doings(racer: Racer, now) -> list[Doing]:
    return doings_of_followed(racer, followed_by(racer), now)


def timed(race, racer, time: int, now) -> None:
    drive(race, racer, laps(time, time, time), now)
    tell_what_happened(now=now)


def test_followers_hear_of_a_lead_once_a_day_and_by_mail_only_if_they_ask(alice, bob, charlie, now, wakes):
    for follower in (alice, charlie):
        follow_racer(follower=follower, racer=bob, now=now)
    race = a_race(now, name="Night race")
    timed(race, bob, 12_000, now)
    assert told(alice) == []  # nobody else is on the board
    timed(race, a_racer(), 11_000, now)
    timed(race, bob, 11_500, now)
    assert told(alice) == []  # it does not lead
    timed(race, bob, 10_500, now)
    assert told(alice) == told(charlie) == ["bob leads Night race with 0:10.500."]
    timed(race, bob, 10_400, now)
    assert len(told(alice)) == 1 and told(bob) == []
    assert not Mail.objects.filter(notice__kind="followed").exists()
    timed(race, bob, 10_300, now + timedelta(days=1))
    assert len(told(alice)) == 2


def test_of_races_by_invitation_nothing_is_told_and_only_who_may_see_them_reads_it(alice, bob, charlie, now, wakes):
    secret = a_race(now, visibility=Visibility.INVITATION, organiser=alice)
    from races.entries.services.entries import enter_race

    for racer in (bob, (other := a_racer())):
        enter_race(race=secret, racer=racer, now=now, invited=True)
    admin = a_racer(is_staff=True)
    for follower in (alice, charlie, other, admin):
        follow_racer(follower=follower, racer=bob, now=now)
    timed(secret, other, 11_000, now)
    timed(secret, bob, 10_000, now)
    assert not Notice.objects.filter(kind="followed").exists()
    seen = {who: [one.race for one in doings(who, now)] for who in (alice, charlie, other, admin)}
    assert seen == {alice: [secret], charlie: [], other: [secret], admin: [secret]}


def test_a_best_stands_once_as_it_is_now(alice, bob, now, wakes):
    race, left = a_race(now), a_race(now)
    for time in (12_000, 11_000, 13_000):
        timed(race, bob, time, now)
    timed(left, bob, 9_000, now)
    withdraw(entry=left.entries.get(racer=bob), now=now)
    assert doings(alice, now) == []
    follow_racer(follower=alice, racer=bob, now=now)
    assert [(one.what, one.race, one.entry.best_lap_ms) for one in doings(alice, now)] == [("best", race, 11_000)]
    assert doings(alice, now + timedelta(days=31)) == []
    Racer.objects.filter(pk=bob.pk).update(is_active=False)
    assert doings(alice, now) == []


def test_a_round_that_is_won_is_told(alice, bob, charlie, wakes):
    follow_racer(follower=alice, racer=bob, now=timezone.now())
    round_ = a_round(a_season(), 1, "open-qualifier")
    board(round_.race, [bob, charlie])
    now = after(round_)
    close_round(round=round_, now=now)
    tell_what_happened(now=now)
    assert [one for one in told(alice) if "has won" in one]
    assert ("won", bob, round_.race) in [(one.what, one.racer, one.race) for one in doings(alice, now)]


def test_a_cup_and_a_promotion(alice, bob, now):
    follow_racer(follower=alice, racer=bob, now=now)
    race = a_race(now, opens_at=now - timedelta(days=2), closes_at=now - timedelta(days=1))
    cup = Cup.objects.create(day=now.date(), race=race, over_at=now)
    CupPlace.objects.create(cup=cup, division=2, racer=bob, place=1, qualified=3)
    record(CUP_OVER, at=now, race=race.pk, subject=str(cup.day), once=str(cup.day), cars=2)
    record(PROMOTED, at=now, racer=bob.pk, race=race.pk, subject="gone", round=1)
    tell_what_happened(now=now)
    assert told(alice) == [f"bob has won division 2 of the cup of {cup.day}."]
    assert [(one.what, one.division) for one in doings(alice, now)] == [("cup", 2)]


def test_more_doings_cost_the_page_no_more_queries(alice, wakes):
    season = a_season(promotion_percent=50)
    first, client = a_round(season, 1, "open-qualifier"), Client()
    field = racers(12)
    board(first.race, field)
    now = after(first)
    close_round(round=first, now=now)
    sent = []
    with patch("django.utils.timezone.now", lambda: now):
        client.force_login(alice, backend=BACKEND)
        for racer in field[:6]:
            follow_racer(follower=alice, racer=racer, now=now)
            assert f"/racers/{racer.alias}/" in client.get("/following/").content.decode()
            sent.append(len(queries(client, "/following/")))
    promoted = [one for one in doings(alice, now) if one.what == "promoted"]
    assert len(promoted) == 6 and set(sent) == {sent[0]}


def test_more_wins_and_cups_cost_the_page_no_more_queries(alice, now, wakes):
    client, sent = Client(), []
    client.force_login(alice, backend=BACKEND)
    for number in range(3):
        day, winner = now.date() - timedelta(days=number), a_racer(f"winner-{number}")
        won, cup_race = a_race(now, name=f"Won {number}"), a_race(now)
        for racer, time in ((winner, 9_000), (a_racer(), 9_500)):
            timed(won, racer, time, now)
        record(RACE_OFFICIAL, at=now, race=won.pk, subject=won.slug, once=f"{won.pk}")
        cup = Cup.objects.create(day=day, race=cup_race, over_at=now)
        CupPlace.objects.create(cup=cup, division=1, racer=winner, place=1, qualified=1)
        record(CUP_OVER, at=now, race=cup_race.pk, subject=str(day), once=str(day), cars=2)
        follow_racer(follower=alice, racer=winner, now=now)
        sent.append(len(queries(client, "/following/")))
        found = {(one.what, one.racer) for one in doings(alice, now)}
        assert found >= {("won", winner), ("cup", winner), ("best", winner)}
    assert sent[0] == sent[1] == sent[2] <= 8, sent


def test_a_win_in_a_private_race_is_for_those_in_it(alice, bob, charlie, now, wakes):
    secret = a_race(now)
    for racer, time in ((bob, 9_000), (charlie, 9_500)):
        timed(secret, racer, time, now)
    secret.visibility = Visibility.INVITATION
    secret.save(update_fields=["visibility"])
    record(RACE_OFFICIAL, at=now, race=secret.pk, subject=secret.slug, once="closed")
    for follower in (alice, charlie):
        follow_racer(follower=follower, racer=bob, now=now)
    with parts_are_kept():
        seen = {who: {one.what for one in doings(who, now)} for who in (charlie, alice)}
    assert seen == {charlie: {"won", "best"}, alice: set()}


def test_the_pages(alice, bob, charlie, now, wakes):
    me, guest = Client(), Client()
    me.force_login(alice, backend=BACKEND)
    race = a_race(now, name="Night race")
    timed(race, bob, 11_000, now)
    assert guest.get("/following/").status_code == 302 and guest.post("/racers/bob/follow/").status_code == 302
    assert me.get("/racers/bob/follow/").status_code == 405 and me.post("/racers/nobody/follow/").status_code == 404
    assert "You follow no racers yet" in me.get("/following/").content.decode()
    assert "/racers/bob/follow/" in me.get("/racers/bob/").content.decode()
    assert "You follow bob." in me.post("/racers/bob/follow/", follow=True).content.decode()
    page = me.get("/racers/bob/").content.decode()
    assert "followers: 1" in page and "/racers/bob/unfollow/" in page and "/racers/bob/follow/" not in page
    assert "/follow/" not in guest.get("/racers/bob/").content.decode()
    listed = me.get("/following/").content.decode()
    assert "has a new best:" in listed and "Night race" in listed
    assert me.post("/racers/alice/follow/", follow=True).content.decode().count("You cannot follow this racer") == 1
    assert me.post("/racers/bob/unfollow/", {"from": "list"})["Location"] == "/following/"
    assert "followers:" not in me.get("/racers/bob/").content.decode()


def test_who_had_chosen_among_notices_gets_no_mail_either(alice):
    from importlib import import_module

    from django.apps import apps

    NoticeChoice.objects.create(racer=alice, mail_off=["result"])
    import_module("league.migrations.0004_follow_notices").not_by_mail(apps, None)
    assert NoticeChoice.objects.get().mail_off == ["followed", "result"]


def test_who_is_asked_to_join_a_team_is_told(alice, bob, now):
    team = found_team(by=alice, name="Comets", now=now)
    invite_to_team(team=team, alias="bob", by=alice, now=now)
    tell_what_happened(now=now)
    assert told(bob, "team") == ["The team Comets asks you to join."] and told(alice, "team") == []
    assert Notice.objects.get(kind="team").path == team.get_absolute_url()
    TeamInvitation.objects.all().delete()
    invite_to_team(team=team, alias="bob", by=alice, now=now)  # again on the same day
    tell_what_happened(now=now)
    assert len(told(bob, "team")) == 1
    charlie = a_racer("charlotte")
    invite_to_team(team=team, alias="charlotte", by=alice, now=now)
    TeamInvitation.objects.filter(racer=charlie).delete()  # answered before it was told
    tell_what_happened(now=now)
    assert told(charlie, "team") == []
