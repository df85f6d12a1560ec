"""Teams: captains, invitations by alias and by link, leaving, races for teams and their boards."""

from __future__ import annotations

from importlib import import_module

import pytest
from django.apps import apps
from django.test import Client
from django.utils import timezone

from accounts.models import Racer, Team, TeamInvitation, TeamMember
from accounts.teams import services
from accounts.teams.services import (
    accept_team,
    decline_team,
    found_team,
    hand_over_team,
    invitations_visible_to,
    invite_to_team,
    join_by_link,
    leave_team,
    new_team_link,
    remove_from_team,
    team_of,
)
from core.events import Event
from league.standings.selectors.standings import season_standings
from league.stewarding.official_results import close_round
from paddock.errors import UserFault
from races.boards.selectors.board import team_board
from races.entries.services.entries import enter_race, withdraw
from tests.factories import a_race, a_racer, drive, laps
from tests.league.seasons import a_round, a_season, after, board

pytestmark = pytest.mark.django_db


def code(call) -> str:
    with pytest.raises(UserFault) as refused:
        call()
    return refused.value.code


@pytest.fixture
def reds(alice, now) -> Team:
    return found_team(by=alice, name=" The  Reds ", now=now)


def test_a_team_has_one_spelling_and_a_captain(reds, alice, bob, now):
    alice.refresh_from_db()
    assert (reds.name, reds.captain, alice.team, team_of(alice)) == ("The Reds", alice, "The Reds", reds)
    assert code(lambda: found_team(by=bob, name="the REDS", now=now)) == "team_name_taken"
    assert code(lambda: found_team(by=alice, name="Blues", now=now)) == "team_in_one_already"


def test_a_captain_asks_and_a_racer_accepts_or_declines(reds, alice, bob, charlie, now):
    asked = invite_to_team(team=reds, alias="BOB", by=alice, now=now)
    invite_to_team(team=reds, alias="bob", by=alice, now=now)
    assert Event.objects.filter(kind="team.invited", racer_id=bob.pk).count() == 1
    for viewer, sees in ((None, False), (charlie, False), (bob, True), (alice, True), (a_racer(is_staff=True), True)):
        assert invitations_visible_to(viewer).filter(pk=asked.pk).exists() is sees
    assert code(lambda: accept_team(invitation=asked, racer=charlie, now=now)) == "team_not_asked"
    assert code(lambda: decline_team(invitation=asked, by=charlie)) == "team_captain_only"
    accept_team(invitation=asked, racer=bob, now=now)
    assert team_of(bob) == reds and not TeamInvitation.objects.exists()
    assert code(lambda: invite_to_team(team=reds, alias="bob", by=alice, now=now)) == "team_in_it_already"
    assert code(lambda: invite_to_team(team=reds, alias="nobody", by=alice, now=now)) == "team_no_such_racer"
    assert code(lambda: invite_to_team(team=reds, alias="charlie", by=bob, now=now)) == "team_captain_only"
    gone = invite_to_team(team=reds, alias="charlie", by=alice, now=now)
    decline_team(invitation=gone, by=alice)
    assert code(lambda: accept_team(invitation=gone, racer=charlie, now=now)) == "team_not_asked"


def test_a_link_joins_until_it_is_replaced_or_the_team_is_full(reds, alice, bob, charlie, now, monkeypatch):
    old = reds.code
    join_by_link(code=old, racer=bob, now=now)
    new_team_link(team=reds, by=alice)
    assert code(lambda: join_by_link(code=old, racer=charlie, now=now)) == "team_link_unknown"
    monkeypatch.setattr(services, "MEMBERS", 2)
    assert code(lambda: join_by_link(code=reds.code, racer=charlie, now=now)) == "team_full"
    assert code(lambda: new_team_link(team=reds, by=bob)) == "team_captain_only"


def test_a_captain_hands_over_before_leaving_and_the_last_one_closes_the_team(reds, alice, bob, charlie, now):
    join_by_link(code=reds.code, racer=bob, now=now)
    assert code(lambda: leave_team(racer=alice)) == "team_hand_over_first"
    assert code(lambda: remove_from_team(team=reds, racer=alice, by=bob)) == "team_captain_only"
    assert code(lambda: hand_over_team(team=reds, to=charlie, by=alice)) == "team_not_a_member"
    hand_over_team(team=reds, to=bob, by=alice)
    remove_from_team(team=reds, racer=alice, by=bob)
    alice.refresh_from_db()
    assert alice.team == "" and team_of(alice) is None
    leave_team(racer=bob)
    assert not Team.objects.exists() and not TeamMember.objects.exists()


def test_a_race_for_teams_takes_one_car_of_each_or_several(reds, alice, bob, charlie, now):
    join_by_link(code=reds.code, racer=bob, now=now)
    several, one = a_race(now, team_entries="several"), a_race(now, team_entries="one")
    for race in (several, one):
        assert code(lambda race=race: enter_race(race=race, racer=charlie, now=now)) == "race_needs_team"
        enter_race(race=race, racer=alice, now=now)
    enter_race(race=several, racer=bob, now=now)
    with pytest.raises(UserFault) as refused:
        enter_race(race=one, racer=bob, now=now)
    assert (refused.value.code, refused.value.params["racer"]) == ("race_team_has_entry", "alice")
    withdraw(entry=one.entries.get(racer=alice), now=now)
    enter_race(race=one, racer=bob, now=now)
    assert code(lambda: enter_race(race=one, racer=alice, now=now)) == "race_team_has_entry"


def test_a_team_stands_where_its_best_car_does(reds, alice, bob, charlie, now):
    now = timezone.now()
    join_by_link(code=reds.code, racer=bob, now=now)
    blues = found_team(by=charlie, name="Blues", now=now)
    race = a_race(now, team_entries="several")
    for racer, time in ((bob, 10_000), (charlie, 10_500), (alice, 11_000)):
        drive(race, racer, laps(time, time, time), now)
    rows = team_board(race)
    assert [(row.rank, row.team, row.places) for row in rows] == [(1, reds, [1, 3]), (2, blues, [2])]
    page = Client().get(f"{race.get_absolute_url()}?by=teams").content.decode()
    assert "The Reds" in page and "1, 3" in page
    assert "Best car" not in Client().get(race.get_absolute_url()).content.decode()


def test_points_stay_with_the_team_that_they_were_driven_for(reds, alice, now):
    season = a_season()
    round_ = a_round(season, 1, "open-qualifier")
    alice.refresh_from_db()
    board(round_.race, [alice])
    close_round(round=round_, now=after(round_))
    leave_team(racer=alice)
    assert [(line.holder, line.points) for line in season_standings(season, "open", "teams")] == [
        ("the reds", season.points[0])
    ]


def test_teams_of_before_become_teams_with_who_wrote_their_name():
    first, second, other = a_racer(team="Red  Bulls"), a_racer(team="red bulls"), a_racer(team="New")
    house, plain = a_racer(team="Red Bulls", is_house=True), a_racer()
    import_module("accounts.migrations.0005_teams").make_teams(apps, None)
    reds = Team.objects.get(key="red bulls")
    assert (reds.name, reds.captain) == ("Red Bulls", first)
    assert set(reds.members.values_list("racer", flat=True)) == {first.pk, second.pk}
    second.refresh_from_db()
    assert second.team == "Red Bulls" and team_of(other).slug != "new"
    assert team_of(house) is None and team_of(plain) is None


def test_the_pages_and_the_api(alice, bob, charlie, now):
    captain, racer, stranger = Client(), Client(), Client()
    for client, who in ((captain, alice), (racer, bob), (stranger, charlie)):
        client.force_login(who, backend="django.contrib.auth.backends.ModelBackend")
    where = captain.post("/teams/new/", {"name": "Owls"})["Location"]
    assert "There is a team of this name." in stranger.post("/teams/new/", {"name": "owls"}).content.decode()
    team = Team.objects.get()
    assert team.code in captain.get(where).content.decode() and team.code not in racer.get(where).content.decode()
    captain.post(where, {"do": "invite", "racer": "bob"})
    assert "asks you to join" in racer.get("/teams/").content.decode()
    assert "asks you to join" not in stranger.get("/teams/").content.decode()
    assert stranger.post(where, {"do": "accept"}).status_code == 404
    assert "Only the captain" in stranger.post(where, {"do": "link"}, follow=True).content.decode()
    racer.post(where, {"do": "accept"})
    assert team_of(bob) == team and "Owls" in Client().get("/racers/bob/").content.decode()
    assert "Join the team" in stranger.get(f"/teams/join/{team.code}/").content.decode()
    assert "You are in the team." in stranger.post(f"/teams/join/{team.code}/", follow=True).content.decode()
    assert stranger.get("/teams/join/none/").status_code == 404
    captain.post(where, {"do": "remove", "racer": "charlie"})
    assert team_of(charlie) is None
    assert stranger.patch("/api/v1/me/", {"team": "OWLS"}, content_type="application/json").status_code == 403
    assert racer.patch("/api/v1/me/", {"team": ""}, content_type="application/json").json()["team"] == ""
    assert team_of(bob) is None and not Racer.objects.filter(alias="bob").exclude(team="").exists()
    captain.post("/teams/leave/")
    assert not Team.objects.exists()


def test_a_team_whose_captains_account_is_deleted_is_led_on_by_the_longest_in_it(reds, alice, bob, charlie, now):
    """And not by who joins next by the link."""
    join_by_link(code=reds.code, racer=bob, now=now)
    alice.delete()
    reds.refresh_from_db()
    assert reds.captain == bob
    join_by_link(code=reds.code, racer=charlie, now=now)
    reds.refresh_from_db()
    assert reds.captain == bob and {member.racer for member in reds.members.all()} == {bob, charlie}
    bob.delete()
    reds.refresh_from_db()
    assert reds.captain == charlie
    charlie.delete()
    assert not Team.objects.exists(), "nobody is in it"
