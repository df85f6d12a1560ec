"""Races through the API: finding, making, changing, cancelling, inviting."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from races.entries.services.entries import enter_race
from races.models import Race, RaceKind, Visibility
from tests.factories import a_race, a_track, drive, laps

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/races/"


@pytest.fixture
def now():
    return timezone.now()


def new_race(now, **fields) -> dict:
    return {
        "name": "Friday Night",
        "track": "oval",
        "opens_at": now.isoformat(),
        "closes_at": (now + timedelta(days=3)).isoformat(),
        **fields,
    }


def slugs(answer) -> set[str]:
    assert answer.status_code == 200, answer.data
    return {row["slug"] for row in answer.data["results"]}


def test_races_can_be_filtered_by_state_kind_and_organiser(alice, bob, now, as_racer):
    week = timedelta(days=7)
    a_race(now, slug="open")
    a_race(now, slug="league", kind=RaceKind.LEAGUE, division="open")
    a_race(now, slug="later", opens_at=now + week, closes_at=now + 2 * week, organiser=alice)
    a_race(now, slug="over", opens_at=now - 2 * week, closes_at=now - week)
    a_race(now, slug="called-off", cancelled_at=now, cancel_reason="Rain")
    anybody, hers, his = as_racer(None), as_racer(alice), as_racer(bob)
    assert slugs(anybody.get(ADDRESS)) == {"open", "league", "later", "over", "called-off"}
    assert slugs(anybody.get(ADDRESS, {"state": "open"})) == {"open", "league"}
    assert slugs(anybody.get(ADDRESS, {"state": "upcoming"})) == {"later"}
    assert slugs(anybody.get(ADDRESS, {"state": "closed"})) == {"over"}
    assert slugs(anybody.get(ADDRESS, {"state": "cancelled"})) == {"called-off"}
    assert slugs(anybody.get(ADDRESS, {"state": "open", "kind": "league"})) == {"league"}
    assert slugs(anybody.get(ADDRESS, {"mine": "true"})) == set()
    enter_race(race=Race.objects.get(slug="open"), racer=bob, now=now)
    assert slugs(his.get(ADDRESS, {"mine": "true"})) == {"open"}
    assert slugs(hers.get(ADDRESS, {"mine": "1"})) == {"later"}
    for race in anybody.get(ADDRESS).data["results"]:
        assert anybody.get(f"{ADDRESS}{race['slug']}/").data["state"] == race["state"]


def test_an_unknown_state_is_refused(db, as_racer):
    answer = as_racer(None).get(ADDRESS, {"state": "finished"})
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    assert set(answer.data["fields"]) == {"state"}


def test_more_races_need_no_more_queries(alice, now, as_racer, django_assert_num_queries):
    client = as_racer(alice)
    for _ in range(2):
        a_race(now, organiser=alice)
    with django_assert_num_queries(3):  # token, count, races
        client.get(ADDRESS)
    for _ in range(6):
        a_race(now, organiser=alice)
    with django_assert_num_queries(3):
        assert client.get(ADDRESS).data["count"] == 8


def test_a_race_states_its_rules_in_plain_sentences(now, as_racer):
    race = a_race(now, laps=5, minimum_laps=3)
    shown = as_racer(None).get(f"{ADDRESS}{race.slug}/").data
    assert "3 consecutive complete laps" in shown["ranking_rule"]
    assert "fewer resets" in shown["tie_rule"]
    assert shown["track"] == {"slug": "oval", "name": "Paddock Oval", "length_m": race.track.length_m}


def test_sentences_are_in_the_requested_language(now, as_racer):
    race = a_race(now)
    answer = as_racer(None).get(f"{ADDRESS}{race.slug}/", headers={"Accept-Language": "ko"})
    assert answer["Content-Language"] == "ko"


def test_a_race_is_created_with_sensible_defaults(alice, oval, now, as_racer):
    answer = as_racer(alice).post(ADDRESS, new_race(now))
    assert answer.status_code == 201, answer.data
    assert (answer.data["slug"], answer.data["organiser"], answer.data["kind"]) == (
        "friday-night",
        "alice",
        "community",
    )
    assert (answer.data["laps"], answer.data["ranking_method"], answer.data["visibility"]) == (3, "average", "public")
    assert answer.data["state"] == "open"
    assert answer.data["invitation"] is None
    assert as_racer(None).get(f"{ADDRESS}friday-night/").data["name"] == "Friday Night"


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({"track": "no-such-track"}, "track"),
        ({"name": ""}, "name"),
        ({"name": "x" * 65}, "name"),
        ({"laps": 21}, "laps"),
        ({"laps": 2, "minimum_laps": 3}, "minimum_laps"),
        ({"laps": 3, "minimum_laps": 2, "ranking_method": "total"}, "minimum_laps"),
        ({"ranking_method": "luck"}, "ranking_method"),
        ({"max_resets": -1}, "max_resets"),
        ({"sensors": ["RADAR"]}, "sensors.0"),
        ({"sensors": []}, "sensors"),
        ({"opens_at": "soon"}, "opens_at"),
        ({"closes_at": "2020-01-01T00:00:00Z"}, "closes_at"),
    ],
)
def test_an_invalid_race_is_refused_on_the_field_to_change(alice, oval, now, as_racer, fields, wrong):
    answer = as_racer(alice).post(ADDRESS, new_race(now, **fields))
    assert answer.status_code == 400
    assert wrong in answer.data["fields"]
    assert all("%(" not in each["message"] for errors in answer.data["fields"].values() for each in errors)
    assert not Race.objects.exists()


def test_a_racer_has_a_limited_number_of_races(alice, oval, now, as_racer, settings):
    settings.RACES_PER_RACER = 1
    client = as_racer(alice)
    client.post(ADDRESS, new_race(now))
    answer = client.post(ADDRESS, new_race(now))
    assert (answer.status_code, answer.data["code"]) == (409, "race_limit")


def test_rules_can_change_until_the_first_car_is_sent(alice, bob, now, as_racer):
    race = a_race(now, organiser=alice)
    client, address = as_racer(alice), f"{ADDRESS}{race.slug}/"
    assert client.patch(address, {"laps": 4, "description": "Come!"}).data["laps"] == 4
    drive(race, bob, laps(10_000, 10_000, 10_000), now)
    refused = client.patch(address, {"laps": 5})
    assert (refused.status_code, refused.data["code"]) == (409, "race_has_submissions")
    assert set(refused.data["fields"]) == {"laps"}
    assert client.patch(address, {"description": "Still open."}).status_code == 200


def test_a_cancelled_race_gives_its_reason(alice, now, as_racer):
    race = a_race(now, organiser=alice)
    client, address = as_racer(alice), f"{ADDRESS}{race.slug}/cancel/"
    silent = client.post(address, {"reason": " "})
    assert (silent.status_code, silent.data["code"]) == (400, "cancel_needs_a_reason")
    answer = client.post(address, {"reason": "Rain"})
    assert (answer.status_code, answer.data["state"], answer.data["cancel_reason"]) == (200, "cancelled", "Rain")
    again = client.post(address, {"reason": "Rain"})
    assert (again.status_code, again.data["code"]) == (409, "race_cancelled")


def test_an_invitation_works_until_it_is_reset(alice, bob, charlie, now, as_racer):
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    hers, his, another = as_racer(alice), as_racer(bob), as_racer(charlie)
    secret = hers.get(f"{ADDRESS}{race.slug}/").data["invitation"]
    assert his.get(f"{ADDRESS}{race.slug}/").status_code == 404
    joined = his.post(f"/api/v1/invitations/{secret}/")
    assert (joined.status_code, joined.data["race"]["slug"]) == (200, race.slug)
    assert his.get(f"{ADDRESS}{race.slug}/").data["invitation"] is None
    renewed = hers.post(f"{ADDRESS}{race.slug}/invitation/").data["invitation"]
    assert renewed != secret
    refused = another.post(f"/api/v1/invitations/{secret}/")
    assert (refused.status_code, refused.data["code"]) == (404, "invitation_unknown")
    assert his.get(f"{ADDRESS}{race.slug}/").status_code == 200, "who has joined stays"
    assert another.post(f"/api/v1/invitations/{renewed}/").status_code == 200


def test_an_invitation_race_is_limited_to_its_members(alice, bob, now, cast):
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    address = f"{ADDRESS}{race.slug}/"
    cast["member"].post(f"/api/v1/invitations/{race.invitation}/")
    seen = {role: client.get(address).status_code for role, client in cast.items()}
    assert seen == {"owner": 200, "member": 200, "stranger": 404, "admin": 200, "anonymous": 404}
    assert {role: race.slug in slugs(client.get(ADDRESS)) for role, client in cast.items()} == {
        role: status == 200 for role, status in seen.items()
    }
    expected = {"owner": 200, "member": 403, "stranger": 404, "admin": 200, "anonymous": 401}
    for action in (
        lambda client: client.patch(address, {"description": "?"}),
        lambda client: client.post(f"{address}invitation/"),
    ):
        assert {role: action(client).status_code for role, client in cast.items()} == expected
    cancelled = {role: cast[role].post(f"{address}cancel/", {"reason": "x"}).status_code for role in reversed(cast)}
    assert cancelled == {**expected, "owner": 409}
    for role in ("member", "stranger", "anonymous"):
        assert not cast[role].get(address).data.get("invitation"), role


BOXES = [{"fraction": 0.6, "lane": "outer"}, {"fraction": 0.25, "lane": "inner"}]


def test_a_race_keeps_the_place_of_every_box(alice, now, as_racer):
    a_track()
    client = as_racer(alice)
    made = client.post(ADDRESS, new_race(now, race_type="object_avoidance", boxes=BOXES))
    assert made.status_code == 201, made.data
    read = as_racer(None).get(f"{ADDRESS}{made.data['slug']}/").data
    assert read["boxes"] == BOXES
    assert [(box["fraction"], box["lane"]) for box in read["placed_boxes"]] == [(0.25, "inner"), (0.6, "outer")]
    assert all(isinstance(box[axis], float) for box in read["placed_boxes"] for axis in ("x", "y", "yaw"))
    assert read["random_boxes"] == 0 and read["opponents"] == ""


def test_races_with_drawn_boxes_bots_and_duels_are_created(alice, now, as_racer):
    a_track()
    client = as_racer(alice)
    kinds = (
        {"race_type": "object_avoidance", "random_boxes": 5, "box_distance_m": 1.5, "seed": 4},
        {"race_type": "head_to_head", "opponents": "bots", "bots": 4, "bot_speed_mps": 0.8, "bot_lane_changes": True},
        {"race_type": "head_to_head", "opponents": "models", "duel_format": "bracket", "duel_cars": 2},
    )
    for fields in kinds:
        made = client.post(ADDRESS, new_race(now, **fields))
        assert made.status_code == 201, made.data
        read = client.get(f"{ADDRESS}{made.data['slug']}/").data
        assert {name: read[name] for name in fields} == fields
        assert len(read["placed_boxes"]) == fields.get("random_boxes", 0)
    assert len(client.get(ADDRESS, {"race_type": "head_to_head"}).data["results"]) == 2
    assert len(client.get(ADDRESS, {"race_type": "object_avoidance"}).data["results"]) == 1
    assert client.get(ADDRESS, {"race_type": "chess"}).status_code == 400


@pytest.mark.parametrize(
    ("fields", "field", "code"),
    [
        ({"race_type": "object_avoidance"}, "boxes", "race_needs_boxes"),
        ({"race_type": "object_avoidance", "boxes": BOXES * 6}, "boxes", "race_too_many_boxes"),
        ({"race_type": "object_avoidance", "boxes": BOXES[:1] * 2}, "boxes", "boxes_overlap"),
        (
            {"race_type": "object_avoidance", "random_boxes": 10, "box_distance_m": 4},
            "random_boxes",
            "boxes_do_not_fit",
        ),
        ({"boxes": BOXES}, "boxes", "race_has_no_boxes"),
        ({"race_type": "head_to_head"}, "opponents", "race_needs_opponents"),
        ({"race_type": "head_to_head", "opponents": "bots", "bots": 9}, "bots", "race_bot_count"),
        (
            {"race_type": "head_to_head", "opponents": "bots", "bots": 2, "bot_speed_mps": 9},
            "bot_speed_mps",
            "race_bot_speed",
        ),
    ],
)
def test_an_invalid_layout_is_refused_with_its_own_code(alice, now, as_racer, fields, field, code):
    a_track()
    answer = as_racer(alice).post(ADDRESS, new_race(now, **fields))
    assert answer.status_code == 400
    assert answer.data["fields"][field][0]["code"] == code
    assert not Race.objects.exists()


@pytest.mark.parametrize("boxes", ["many", [1], [{"fraction": 0.5}], [{"fraction": "x", "lane": "inner"}], [BOXES]])
def test_malformed_boxes_are_refused(alice, now, as_racer, boxes):
    a_track()
    answer = as_racer(alice).post(ADDRESS, new_race(now, race_type="object_avoidance", boxes=boxes))
    assert answer.status_code == 400 and all(field.startswith("boxes") for field in answer.data["fields"])


def test_a_time_trial_can_become_object_avoidance(alice, now, as_racer):
    client, race = as_racer(alice), a_race(now, slug="mine", organiser=alice)
    path = f"{ADDRESS}{race.slug}/"
    assert client.patch(path, {"race_type": "object_avoidance"}).status_code == 400
    changed = client.patch(path, {"race_type": "object_avoidance", "boxes": BOXES})
    assert changed.status_code == 200 and len(changed.data["placed_boxes"]) == 2
    moved = client.patch(path, {"boxes": [{"fraction": 0.4, "lane": "outer"}]})
    assert moved.data["placed_boxes"][0]["fraction"] == 0.4


def test_a_change_meant_for_an_older_edition_is_refused(alice, now, as_racer):
    client, race = as_racer(alice), a_race(now, organiser=alice)
    address = f"/api/v1/races/{race.slug}/"
    seen = client.get(address).data["edition"]
    first = client.patch(address, {"name": "One", "edition": seen}, format="json")
    assert first.status_code == 200 and first.data["edition"] != seen
    second = client.patch(address, {"name": "Two", "edition": seen}, format="json")
    assert (second.status_code, second.data["code"]) == (409, "race_changed_meanwhile")
    assert client.patch(address, {"name": "Two"}, format="json").data["name"] == "Two"
    assert client.get(address).data["edition"] == client.get(address).data["edition"]
