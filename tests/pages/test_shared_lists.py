"""Lists of races that readers share: each reader sees their own races, and nothing of another's."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from django.db import connection
from django.test import Client
from django.utils import timezone

from accounts.models import GroupMember
from league.models import Membership, Round
from races.entries.selectors.lists import in_state, sees_only_public
from races.entries.selectors.visibility import races_visible_to
from races.entries.services.entries import enter_race
from races.models import Race, Timekeeper, Visibility
from tests.accounts.test_groups import a_group
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.league.seasons import a_season
from tests.soak import only

STATES = ("open", "upcoming", "closed", "cancelled")


@pytest.fixture
def now(wakes):
    return timezone.now()


@pytest.fixture
def readers(now) -> dict:
    """Alice organises a race by invitation, bob is in it; charlie and dora are in a group with a race; erin is in the
    pro division, finn has nothing."""
    racers = {name: a_racer(name) for name in ("alice", "bob", "charlie", "dora", "erin", "finn")}
    season = a_season()
    for stage, division in (("open-qualifier", "open"), ("pro-qualifier", "pro")):
        race = a_race(now, slug=division, name=f"Month {division}", kind="league", division=division)
        Round.objects.create(season=season, number=1, stage=stage, race=race)
    Membership.objects.create(season=season, racer=racers["erin"], division="pro")
    secret = {"visibility": Visibility.INVITATION, "organiser": racers["alice"]}
    enter_race(
        race=a_race(now, slug="secret", name="Secret race", **secret), racer=racers["bob"], now=now, invited=True
    )
    group = a_group(a_racer("leader"), now, racers["charlie"], racers["dora"])
    a_race(now, slug="of-group", name="Race of the group", group=group, visibility=Visibility.INVITATION)
    for name in ("bob", "erin"):
        drive(a_race(now, name=f"Race won by {name}"), racers[name], laps(9_000, 9_000, 9_000), now)
    for racer in racers.values():
        a_model(racer, name=f"Car of {racer.alias}")
    return racers


EXPECTED = {
    "alice": {"Secret race"},
    "bob": {"Secret race"},
    "charlie": {"Race of the group"},
    "dora": {"Race of the group"},
}


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("rounds", only([2], [2, 8]))
def test_readers_at_once_never_get_each_others_parts(rounds, readers, settings, now):
    settings.SHARED_PAGE_SECONDS = 3600
    names = [*readers, *readers]
    clients = {name: Client() for name in readers}
    for name, client in clients.items():
        client.force_login(readers[name], backend="django.contrib.auth.backends.ModelBackend")

    def read(name: str) -> None:
        try:
            for _ in range(rounds):
                for path in ("/", "/races/"):
                    html = clients[name].get(path).content.decode()
                    shown = {race for race in ("Secret race", "Race of the group") if race in html}
                    assert shown == EXPECTED.get(name, set()), (name, path)
                    assert f"<summary>{name}</summary>" in html
                    others = [f"Car of {other}" for other in readers if other != name]
                    assert not [car for car in others if car in html], (name, path)
                    if path == "/":
                        assert f"Car of {name}" in html
                        closed = "Month open" if name == "erin" else "Month pro"
                        cards, _, folded = html.partition('id="all-races"')
                        assert closed not in cards.partition('id="home-races"')[2] and closed in folded
        finally:
            connection.close()

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(read, names))


@pytest.mark.django_db
@pytest.mark.parametrize("state", STATES)
def test_who_sees_more_than_public_races_agrees_with_the_permission(readers, now, state):
    past, coming = now - timedelta(days=9), now + timedelta(days=2)
    times = {
        "open": {},
        "upcoming": {"opens_at": coming, "closes_at": coming + timedelta(days=1)},
        "closed": {"opens_at": past, "closes_at": past + timedelta(days=1)},
        "cancelled": {"cancelled_at": now, "cancel_reason": "Rain."},
    }[state]
    kept = a_racer("keeper")
    Race.objects.exclude(visibility=Visibility.PUBLIC).update(**times)
    physical = a_race(now, visibility=Visibility.INVITATION, organiser=None, **times)
    Race.objects.filter(pk=physical.pk).update(physical=True)
    Timekeeper.objects.create(race=physical, racer=kept)
    removed, unconfirmed, admin = a_racer("removed"), a_racer("unconfirmed"), a_racer("admin", is_staff=True)
    secret = Race.objects.get(slug="secret")
    secret.entries.create(racer=removed, entered_at=now, withdrawn_at=now, removed_at=now)
    GroupMember.objects.create(group=Race.objects.get(slug="of-group").group, racer=unconfirmed, asked_at=now)
    everybody = [*readers.values(), kept, removed, unconfirmed, admin, None]
    for reader in everybody:
        for asked in STATES:
            seen = races_visible_to(reader).filter(in_state(asked, now)).exclude(visibility=Visibility.PUBLIC)
            assert sees_only_public(reader, (asked,), now) is not seen.exists(), (reader, asked)
