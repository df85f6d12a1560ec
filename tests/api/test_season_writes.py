"""What admins write about the league through the API, and what nobody else may."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.contrib.auth.models import Permission
from django.utils import timezone

from accounts.models import Racer
from league.models import Round, Season
from league.stewarding.official_results import close_round
from races.models import Race
from tests.factories import a_race, a_track
from tests.league.seasons import a_round, a_season, after

pytestmark = pytest.mark.django_db
NEW = {"slug": "2031", "name": "Season 2031", "starts_on": "2031-01-01", "ends_on": "2031-12-31"}
OUTSIDERS = {"owner": 403, "member": 403, "stranger": 403, "anonymous": 401}


def a_race_of(**fields) -> dict:
    """Around the clock that the API reads."""
    now = timezone.now()
    a_track()
    return {
        "name": "January open",
        "track": "oval",
        "opens_at": (now + timedelta(days=1)).isoformat(),
        "closes_at": (now + timedelta(days=9)).isoformat(),
    } | fields


@pytest.mark.parametrize("role", OUTSIDERS)
def test_only_admins_write_to_the_league(cast, role):
    season = a_season()
    writes = [
        ("post", "/api/v1/seasons/", NEW),
        ("patch", f"/api/v1/seasons/{season.slug}/", {"name": "Mine"}),
        ("patch", f"/api/v1/seasons/{season.slug}/stages/open-qualifier/", {"laps": 4}),
        ("post", f"/api/v1/seasons/{season.slug}/rounds/", a_race_of(number=1, stage="open-qualifier")),
        ("post", "/api/v1/races/", a_race_of(division="all")),
    ]
    answers = [getattr(cast[role], method)(path, body).status_code for method, path, body in writes]
    assert answers == [OUTSIDERS[role]] * len(writes)
    assert (Season.objects.count(), Race.objects.count(), LogEntry.objects.count()) == (1, 0, 0)


def test_staff_need_the_permission_too(as_racer):
    clerk = Racer.objects.create_user("clerk", "clerk@example.org", is_staff=True)
    assert as_racer(clerk).post("/api/v1/seasons/", NEW).status_code == 403
    clerk.user_permissions.add(Permission.objects.get(codename="add_season"))
    assert as_racer(clerk).post("/api/v1/seasons/", NEW).status_code == 201


def test_an_admin_creates_a_season_with_rules_and_rounds(cast):
    admin = cast["admin"]
    made = admin.post("/api/v1/seasons/", NEW | {"points": [10, 5], "promotion_percent": "20.0"})
    assert (made.status_code, made.data["points"], made.data["races"]) == (201, [10, 5], 0)
    rules = admin.patch("/api/v1/seasons/2031/stages/open-qualifier/", {"laps": 4, "minimum_laps": 2})
    assert (rules.status_code, rules.data["laps"], rules.data["minimum_laps"]) == (200, 4, 2)
    body = a_race_of(number=1, month="January", stage="open-qualifier", slug="2031-01-open", max_submissions=7)
    made = admin.post("/api/v1/seasons/2031/rounds/", body)
    assert (made.status_code, made.data["race"], made.data["state"]) == (201, "2031-01-open", "upcoming")
    race = Race.objects.get(slug="2031-01-open")
    assert (race.kind, race.division, race.laps, race.max_submissions) == ("league", "open", 4, 7)
    assert admin.get("/api/v1/seasons/2031/").data["races"] == 1
    assert admin.patch("/api/v1/races/2031-01-open/", {"name": "Renamed"}).status_code == 200
    assert admin.post("/api/v1/races/2031-01-open/cancel/", {"reason": "Rain"}).status_code == 200
    assert LogEntry.objects.filter(change_message__contains="through the API").count() == 3


def test_a_single_league_race_needs_no_season(cast):
    made = cast["admin"].post("/api/v1/races/", a_race_of(division="all"))
    assert (made.status_code, made.data["kind"], made.data["division"]) == (201, "league", "all")
    assert made.data["organiser"] is None


@pytest.mark.parametrize(
    ("changes", "field", "code"),
    [
        ({"points": [1, 2]}, "points", "season_points_rise"),
        ({"promotion_percent": "100.0"}, "promotion_percent", "season_cut"),
        ({"slug": "new"}, "slug", "season_address_reserved"),
        ({"slug": "Now"}, "slug", "season_address_reserved"),
        ({"ends_on": "2030-01-01"}, "", "season_ends_after_start"),
        ({"edition": "x"}, "edition", "unknown_field"),
    ],
)
def test_an_invalid_season_is_refused_on_its_field(cast, changes, field, code):
    answer = cast["admin"].post("/api/v1/seasons/", NEW | changes)
    assert answer.status_code == 400, answer.data
    assert field in answer.data["fields"], answer.data
    if code != "season_ends_after_start":
        assert answer.data["fields"][field][0]["code"] == code
    assert not Season.objects.exists()


def test_a_stale_change_of_a_season_is_refused(cast):
    season = a_season()
    path = f"/api/v1/seasons/{season.slug}/"
    edition = cast["admin"].get(path).data["edition"]
    changed = cast["admin"].patch(path, {"prizes": "A cup.", "edition": edition})
    assert (changed.status_code, changed.data["prizes"]) == (200, "A cup.")
    late = cast["admin"].patch(path, {"prizes": "Two cups.", "edition": edition})
    assert (late.status_code, late.data["code"]) == (409, "season_changed_meanwhile")
    season.refresh_from_db()
    assert season.prizes == "A cup."


def test_settings_behind_official_results_are_fixed(cast):
    season = a_season()
    january = a_round(season, 1, "open-qualifier")
    close_round(round=january, now=after(january))
    path = f"/api/v1/seasons/{season.slug}/"
    refused = cast["admin"].patch(path, {"points": [3, 2, 1], "prizes": "A cup."})
    assert (refused.status_code, refused.data["code"]) == (409, "season_is_official")
    assert refused.data["params"] == {"fields": "points"}
    assert cast["admin"].patch(path, {"prizes": "A cup.", "points": season.points}).status_code == 200


@pytest.mark.parametrize(
    "body",
    [
        {"stage": "nonsense"},
        {"number": 0},
        {"closes_at": "2020-01-01T00:00:00Z"},
        {"minimum_laps": 9},
        {"visibility": "invitation"},
        {"track": "nothing"},
    ],
)
def test_an_invalid_round_is_refused_and_creates_no_race(cast, body):
    season = a_season()
    sent = a_race_of(number=1, stage="open-qualifier") | body
    answer = cast["admin"].post(f"/api/v1/seasons/{season.slug}/rounds/", sent)
    assert answer.status_code == 400, answer.data
    assert not Race.objects.exists()


def test_a_stage_of_a_round_has_only_one_race(cast):
    season = a_season()
    path = f"/api/v1/seasons/{season.slug}/rounds/"
    assert cast["admin"].post(path, a_race_of(number=1, stage="pro-qualifier")).status_code == 201
    again = cast["admin"].post(path, a_race_of(number=1, stage="pro-qualifier"))
    assert again.status_code == 400
    assert Round.objects.count() == Race.objects.count() == 1


def test_unknown_seasons_and_rounds_are_not_found(cast, now):
    a_race(now)
    assert cast["admin"].patch("/api/v1/seasons/nothing/", {"name": "X"}).status_code == 404
    assert cast["admin"].post("/api/v1/seasons/nothing/rounds/", {}).status_code == 404
    season = a_season()
    assert cast["admin"].patch(f"/api/v1/seasons/{season.slug}/stages/nothing/", {}).status_code == 404
