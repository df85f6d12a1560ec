"""Groups of racers: who sees them, who may do what, races for one alone, and boards of one."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db.models import ProtectedError
from django.test import Client
from django.utils import timezone

from accounts.groups import services
from accounts.groups.selectors import (
    groups_to_hold_for,
    groups_visible_to,
    is_in,
    may_hold_for,
    members_visible_to,
)
from accounts.models import GroupMember, Racer, RacerGroup
from league.standings.selectors.standings import standings_among
from league.stewarding.official_results import close_round
from paddock.errors import UserFault
from races.boards.selectors.board import group_board, groups_on
from races.boards.selectors.shared_boards import shared_board
from races.entries.selectors.visibility import (
    can_see_evaluation,
    can_see_race,
    evaluations_visible_to,
    races_visible_to,
)
from races.entries.services.entries import enter_race, remove_entry
from races.errors import RaceRefused
from races.models import Visibility
from races.pages.services import create_community_race, edit_race
from tests.clients import logged_in
from tests.factories import a_race, a_racer, a_track, drive, laps
from tests.league.seasons import a_round, a_season, after, board

pytestmark = pytest.mark.django_db


def a_group(leader: Racer, now, *members: Racer, listed: bool = False, name: str = "Class 5b") -> RacerGroup:
    group = services.make_group(by=leader, name=name, now=now)
    for racer in members:
        asked = services.ask_to_join(code=group.code, racer=racer, now=now)
        services.confirm_member(member=asked, by=leader, now=now)
    RacerGroup.objects.filter(pk=group.pk).update(is_listed=listed)
    group.refresh_from_db()
    return group


def test_who_sees_a_group_and_who_is_in_it(alice, bob, charlie, now):
    staff, asking = a_racer("boss", is_staff=True), a_racer("asking")
    for listed in (False, True):
        group = a_group(alice, now, bob, listed=listed, name=f"Club {listed}")
        pending = services.ask_to_join(code=group.code, racer=asking, now=now)
        confirmed = GroupMember.objects.get(group=group, racer=bob)
        for viewer, knows, sees_confirmed, sees_pending in (
            (None, listed, listed, False),
            (charlie, listed, listed, False),
            (alice, True, True, True),
            (bob, True, True, False),
            (asking, True, listed, True),
            (staff, True, True, True),
        ):
            assert groups_visible_to(viewer).filter(pk=group.pk).exists() is knows
            for member, sees in ((confirmed, sees_confirmed), (pending, sees_pending)):
                assert members_visible_to(viewer).filter(pk=member.pk).exists() is sees, (viewer, member)
        for racer, may in ((alice, True), (bob, listed), (charlie, listed), (staff, True)):
            assert may_hold_for(racer, group) is may
            assert groups_to_hold_for(racer).filter(pk=group.pk).exists() is may


def test_only_who_leads_a_group_changes_it(alice, bob, charlie, now):
    group = a_group(alice, now, bob)
    asked = services.ask_to_join(code=group.code, racer=charlie, now=now)
    for act in (
        lambda: services.confirm_member(member=asked, by=charlie, now=now),
        lambda: services.remove_member(member=asked, by=bob),
        lambda: services.change_group(group=group, by=bob, name="Ours", description=""),
        lambda: services.hand_over_group(group=group, to=bob, by=bob),
        lambda: services.new_group_link(group=group, by=bob),
        lambda: services.delete_group(group=group, by=bob),
    ):
        with pytest.raises(UserFault) as refused:
            act()
        assert refused.value.code == "group_not_yours"
    assert not is_in(charlie, group)
    services.remove_member(member=asked, by=charlie)  # who asked may take it back
    with pytest.raises(UserFault) as refused:
        services.hand_over_group(group=group, to=charlie, by=alice)
    assert refused.value.code == "group_not_a_member"
    assert services.hand_over_group(group=group, to=bob, by=alice).leader == bob
    old = group.code
    services.new_group_link(group=group, by=bob)
    with pytest.raises(UserFault) as refused:
        services.ask_to_join(code=old, racer=charlie, now=now)
    assert refused.value.code == "group_link_unknown"


def test_a_racer_leads_so_many_groups(alice, now, monkeypatch):
    monkeypatch.setattr(services, "GROUPS_PER_RACER", 1)
    one = services.make_group(by=alice, name="New", now=now)
    assert one.slug not in services.RESERVED
    with pytest.raises(UserFault) as refused:
        services.make_group(by=alice, name="Another", now=now)
    assert refused.value.code == "group_limit"


def test_a_race_of_a_group_is_for_its_members_alone(alice, bob, charlie, now):
    group = a_group(alice, now, bob)
    race = a_race(now, organiser=alice, group=group, visibility=Visibility.INVITATION)
    staff = a_racer("boss", is_staff=True)
    for viewer, sees in ((None, False), (charlie, False), (bob, True), (alice, True), (staff, True)):
        assert can_see_race(viewer, race) is sees
        assert races_visible_to(viewer).filter(pk=race.pk).exists() is sees
    driven = drive(race, bob, laps(10_000, 10_000, 10_000), now).evaluation
    mate = a_racer("mate")
    services.confirm_member(member=services.ask_to_join(code=group.code, racer=mate, now=now), by=alice, now=now)
    for viewer, sees in ((None, False), (charlie, False), (mate, True), (bob, True), (alice, True)):
        assert can_see_evaluation(viewer, driven) is sees
        assert evaluations_visible_to(viewer).filter(pk=driven.pk).exists() is sees
    remove_entry(entry=enter_race(race=race, racer=mate, now=now), by=alice, now=now)
    assert not can_see_race(mate, race) and not races_visible_to(mate).filter(pk=race.pk).exists()
    assert not can_see_evaluation(mate, driven)
    assert not evaluations_visible_to(mate).filter(pk=driven.pk).exists()
    assert logged_in(charlie).get(race.get_absolute_url()).status_code == 404
    assert "Class 5b" in logged_in(bob).get(race.get_absolute_url()).content.decode()


def test_strangers_do_not_enter_the_public_race_of_a_group(alice, bob, charlie):
    now = timezone.now()
    group = a_group(alice, now, bob, listed=True)
    race = a_race(now, group=group)
    enter_race(race=race, racer=bob, now=now)
    with pytest.raises(UserFault) as refused:
        enter_race(race=race, racer=charlie, now=now)
    assert (refused.value.code, refused.value.params["group"]) == ("race_group_only", "Class 5b")
    assert "for members of Class 5b alone" in logged_in(charlie).get(race.get_absolute_url()).content.decode()
    with pytest.raises(ProtectedError):
        group.delete()
    with pytest.raises(UserFault) as refused:
        services.delete_group(group=group, by=alice)
    assert refused.value.code == "group_has_races"


def test_a_race_is_held_for_a_group_that_one_may_use(alice, bob, now):
    group = a_group(alice, now, bob)
    when = {"opens_at": now, "closes_at": now + timedelta(days=1), "track": a_track(), "name": "Ours", "now": now}
    with pytest.raises(RaceRefused) as refused:
        create_community_race(organiser=bob, group=group, visibility=Visibility.INVITATION, **when)
    assert refused.value.code == "race_group_not_yours"
    with pytest.raises(RaceRefused) as refused:
        create_community_race(organiser=alice, group=group, **when)
    assert refused.value.code == "race_group_is_private"
    race = create_community_race(organiser=alice, group=group, visibility=Visibility.INVITATION, **when)
    with pytest.raises(RaceRefused) as refused:
        edit_race(race=race, now=now, visibility=Visibility.PUBLIC)
    assert refused.value.code == "race_group_is_private"
    assert edit_race(race=race, now=now, group=None, visibility=Visibility.PUBLIC).group is None


def test_a_board_shows_a_group_among_itself(alice, bob, charlie, now):
    group = a_group(alice, now, bob, charlie)
    race = a_race(now)
    for racer, time in ((a_racer("first"), 9_000), (bob, 10_000), (a_racer("third"), 10_500), (charlie, 11_000)):
        drive(race, racer, laps(time, time, time), now)
    shown = shared_board(race, charlie, group=group)
    assert [(row.rank, row.alias, row.gap_ms, row.is_me) for row in shown.rows] == [
        (1, "bob", 0, False),
        (2, "charlie", 1_000, True),
    ]
    second = group_board(race, group, page=2, per_page=1)
    assert [(row.rank, row.gap_ms) for row in second.rows] == [(2, 1_000)] and second.pages == 2
    assert groups_on(race, None) == [] and groups_on(race, bob) == [group]
    address = f"{race.get_absolute_url()}?group={group.slug}"
    assert "first" in Client().get(address).content.decode(), "of a group that they do not know guests see the board"
    page = logged_in(bob).get(address).content.decode()
    assert "Class 5b" in page and "charlie" in page and ">third<" not in page


def test_the_standings_of_a_group_give_points_by_its_own_places(alice, now):
    season = a_season()
    round_ = a_round(season, 1, "open-qualifier")
    cast = [a_racer(f"r{number}") for number in range(8)]
    group = a_group(alice, now, cast[5], cast[7], listed=True)
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    table = season.points
    lines = standings_among(season, "open", group)
    assert [(line.holder, line.points) for line in lines] == [(cast[5].pk, table[0]), (cast[7].pk, table[1])]
    page = Client().get(f"/seasons/{season.slug}/standings/?division=open&group={group.slug}").content.decode()
    assert "r5" in page and "r6" not in page


def test_the_pages_of_a_group(alice, bob, charlie, now):
    leader, member, stranger = logged_in(alice), logged_in(bob), logged_in(charlie)
    made = leader.post("/groups/new/", {"name": "Night shift", "description": "We race at night."})
    assert made["Location"] == "/groups/night-shift/"
    group = RacerGroup.objects.get()
    page = leader.get(made["Location"]).content.decode()
    assert group.code in page and "No members yet." in page
    assert stranger.get(made["Location"]).status_code == 404 and Client().get(made["Location"]).status_code == 404
    assert "Night shift" not in stranger.get("/groups/").content.decode()
    link = f"/groups/join/{group.code}/"
    assert "/accounts/login/" in Client().get(link)["Location"]
    assert "Request to join" in member.get(link).content.decode()
    assert member.post(link)["Location"] == made["Location"]
    page = member.get(made["Location"]).content.decode()
    assert "waits for its leader" in page and group.code not in page
    assert (
        "Only the leader"
        in member.post(made["Location"], {"do": "confirm", "racer": "bob"}, follow=True).content.decode()
    )
    assert not is_in(bob, group)
    leader.post(made["Location"], {"do": "confirm", "racer": "bob"})
    assert is_in(bob, group)
    assert leader.post(made["Location"], {"do": "confirm", "racer": "nobody"}).status_code == 404
    member.post("/groups/night-shift/leave/")
    assert not is_in(bob, group)
    assert Client().get("/groups/join/none/").status_code in (302, 404)
    assert stranger.get("/groups/join/none/").status_code == 404
    leader.post(made["Location"], {"do": "link"})
    assert stranger.get(link).status_code == 404
    assert leader.post(made["Location"], {"do": "delete"})["Location"] == "/groups/"
    assert not RacerGroup.objects.exists()
