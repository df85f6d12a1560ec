"""Notices, what a racer wants to be told, profile and tokens through the API."""

from __future__ import annotations

import pytest

from league.models import Notice, NoticeChoice
from league.notices import kinds as notice_kinds

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/notices/"


@pytest.fixture
def told(alice, now) -> list[Notice]:
    """Two things that Alice was told, and one that she only wanted by mail."""

    def one(about: str, **fields: object) -> Notice:
        fields = {"params": {"race": "Night race"}, "path": "/races/night/", "at": now} | fields
        return Notice.objects.create(racer=alice, kind=notice_kinds.OPENS, about=about, **fields)

    return [one("a"), one("b"), one("c", hidden=True)]


def test_notices_are_listed_in_the_readers_language(alice, as_racer, told):
    client = as_racer(alice)
    rows = client.get(ADDRESS).data["results"]
    assert [row["text"] for row in rows] == ["Night race is open."] * 2
    assert client.get(ADDRESS, headers={"Accept-Language": "ko"}).data["results"][0]["text"] != rows[0]["text"]
    read = client.post(f"{ADDRESS}{told[0].pk}/read/").data
    assert read["id"] == told[0].pk and read["read_at"]
    assert client.post(f"{ADDRESS}{told[0].pk}/read/").data["read_at"] == read["read_at"]
    assert [row["id"] for row in client.get(f"{ADDRESS}?unread=true").data["results"]] == [told[1].pk]
    assert [row["id"] for row in client.get(f"{ADDRESS}?unread=false").data["results"]] == [told[0].pk]
    assert client.get(f"{ADDRESS}?unread=perhaps").status_code == 400
    assert client.post(f"{ADDRESS}read/").data == {"marked": 1}
    assert client.post(f"{ADDRESS}read/").data == {"marked": 0}


def test_racers_see_only_their_own_notices(cast, told):
    for role, client in cast.items():
        expected = {"owner": 200, "anonymous": 401}.get(role, 404)
        assert client.post(f"{ADDRESS}{told[0].pk}/read/").status_code == expected, role
        assert role == "anonymous" or len(client.get(ADDRESS).data["results"]) == 2 * (role == "owner"), role
    assert cast["owner"].post(f"{ADDRESS}{told[2].pk}/read/").status_code == 404, "it was by mail only"
    for path in ("", "settings/"):
        assert cast["anonymous"].get(f"{ADDRESS}{path}").status_code == 401


def test_notice_settings_can_be_changed_one_by_one(alice, as_racer):
    client = as_racer(alice)
    usual = {"site_off": [], "mail_off": ["result", "cup", "followed"], "language": "en"}
    assert client.get(f"{ADDRESS}settings/").data == usual
    chosen = client.patch(f"{ADDRESS}settings/", {"site_off": ["opens", "closes"]}).data
    assert chosen == {"site_off": ["closes", "opens"], "mail_off": ["cup", "followed", "result"], "language": "en"}
    assert client.patch(f"{ADDRESS}settings/", {"language": "ko"}).data["site_off"] == ["closes", "opens"]
    for wrong in ({"language": "tlh"}, {"site_off": ["rain"]}, {"mail_off": "opens"}, {"sms_off": []}):
        assert client.patch(f"{ADDRESS}settings/", wrong).status_code == 400
    assert NoticeChoice.objects.get().language == "ko"


def test_a_racer_can_change_country_and_team(alice, as_racer):
    client = as_racer(alice)
    assert client.patch("/api/v1/me/", {"country": "KR", "team": " Night shift "}).data["team"] == "Night shift"
    assert client.patch("/api/v1/me/", {"team": ""}).data["country"] == "KR"
    for wrong in ({"country": "XX"}, {"country": "kr"}, {"team": "a\nb"}, {"team": "x" * 65}, {"alias": "bob"}):
        answer = client.patch("/api/v1/me/", wrong)
        assert (answer.status_code, answer.data["code"]) == (400, "invalid"), wrong
    alice.refresh_from_db()
    assert (alice.country, alice.team, alice.alias) == ("KR", "", "alice")
    assert as_racer(None).patch("/api/v1/me/", {"team": ""}).status_code == 401


def test_racers_list_and_revoke_only_their_own_tokens(alice, bob, as_racer):
    client, other = as_racer(alice), as_racer(alice)
    rows = client.get("/api/v1/auth/tokens/").data["results"]
    assert [row["is_this_one"] for row in rows] == [False, True]
    assert as_racer(bob).delete(f"/api/v1/auth/tokens/{rows[0]['key']}/").status_code == 404
    assert as_racer(None).get("/api/v1/auth/tokens/").status_code == 401
    assert client.delete(f"/api/v1/auth/tokens/{rows[0]['key']}/").status_code == 204
    assert other.get("/api/v1/me/").status_code == 401 and client.get("/api/v1/me/").status_code == 200
