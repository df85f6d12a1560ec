"""Making, changing and cancelling races."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from django.utils import timezone

from evaluation.models import State
from paddock.errors import UserFault
from races.entries.services.entries import accept_invitation, enter_race
from races.entries.services.submissions import submit_model
from races.errors import RaceRefused
from races.models import Race, RaceKind, RaceState, Visibility
from races.models.sensors import OFFERABLE, SAME_AS
from races.pages.services import (
    add_months,
    cancel_race,
    clone_race,
    create_community_race,
    create_league_race,
    edit_race,
    reset_invitation,
)
from tests.factories import a_model, a_race, a_track, drive, laps, start

pytestmark = pytest.mark.django_db


def make(organiser, now, **fields) -> Race:
    options = {
        "name": "Friday sprint",
        "track": a_track(),
        "opens_at": now + timedelta(hours=1),
        "closes_at": now + timedelta(days=2),
    }
    return create_community_race(organiser=organiser, now=now, **(options | fields))


def refusal(call, *args, **kwargs) -> dict[str, str]:
    """What a refused race says: the first reason code by field."""
    with pytest.raises(RaceRefused) as caught:
        call(*args, **kwargs)
    assert "?" not in str(caught.value)
    return {field: errors[0].code for field, errors in caught.value.errors.error_dict.items()}


def test_any_racer_can_create_a_race(alice, now):
    race = make(
        alice, now, laps=5, minimum_laps=2, ranking_method="best", off_track_penalty_ms=1500, visibility="invitation"
    )
    race.refresh_from_db()
    assert (race.kind, race.division, race.organiser) == (RaceKind.COMMUNITY, "", alice)
    assert (race.slug, race.name, race.created_at) == ("friday-sprint", "Friday sprint", now)
    assert (race.laps, race.minimum_laps, race.ranking_method, race.off_track_penalty_ms) == (5, 2, "best", 1500)
    assert len(race.invitation) == 32


def test_races_of_the_same_name_get_different_addresses(alice, now):
    first, second = make(alice, now), make(alice, now)
    assert first.slug == "friday-sprint"
    assert second.slug.startswith("friday-sprint-") and len(second.slug) > len("friday-sprint-")


@pytest.mark.parametrize("name", ["New", "한국 레이스", "!!!"])
def test_a_race_address_is_never_empty_or_a_page_of_the_site(alice, now, name):
    slug = make(alice, now, name=name).slug
    assert slug not in ("new", "") and slug[0] != "-"


def test_the_state_of_a_race_depends_on_the_time(alice, now):
    race = make(alice, now)
    tick = timedelta(microseconds=1)
    assert race.state_at(race.opens_at - tick) == RaceState.UPCOMING
    assert race.state_at(race.opens_at) == RaceState.OPEN
    assert race.state_at(race.closes_at - tick) == RaceState.OPEN
    assert race.state_at(race.closes_at) == RaceState.CLOSED


@pytest.mark.parametrize(
    ("fields", "refused"),
    [
        ({"name": "  "}, {"name": "blank"}),
        ({"name": "x" * 65}, {"name": "max_length"}),
        ({"laps": 3, "minimum_laps": 4}, {"minimum_laps": "race_minimum_laps"}),
        ({"laps": 5, "minimum_laps": 3, "ranking_method": "total"}, {"minimum_laps": "race_total_needs_all_laps"}),
        ({"laps": 0, "minimum_laps": 0}, {"laps": "min_value", "minimum_laps": "min_value"}),
        ({"laps": 21, "minimum_laps": 3}, {"laps": "max_value"}),
        ({"ranking_method": "luck"}, {"ranking_method": "invalid_choice"}),
        ({"direction": "up"}, {"direction": "invalid_choice"}),
        ({"sensors": []}, {"sensors": "blank"}),
        ({"sensors": ["FRONT_FACING_CAMERA", "FRONT_FACING_CAMERA"]}, {"sensors": "race_sensors"}),
        ({"sensors": ["LIDAR"]}, {"sensors": "race_sensors"}),
        ({"sensors": "FRONT_FACING_CAMERA"}, {"sensors": "race_sensors"}),
        ({"off_track_penalty_ms": 60_001}, {"off_track_penalty_ms": "max_value"}),
        ({"off_track_penalty_ms": -1}, {"off_track_penalty_ms": "min_value"}),
        ({"max_submissions": 0}, {"max_submissions": "min_value"}),
        ({"max_simulated_ms": 1_200_001}, {"max_simulated_ms": "max_value"}),
        ({"laps": "many"}, {"laps": "invalid"}),
    ],
)
def test_an_invalid_race_is_refused_on_the_field_to_change(alice, now, fields, refused):
    assert refusal(make, alice, now, **fields) == refused
    assert not Race.objects.exists()


def test_invalid_times_are_refused(alice, now):
    hour, day = timedelta(hours=1), timedelta(days=1)
    for opens, closes, expected in (
        (2 * hour, hour, {"closes_at": "race_closes_before_opening"}),
        (hour, hour, {"closes_at": "race_closes_before_opening"}),
        (-3 * day, -2 * day, {"closes_at": "race_already_over", "opens_at": "race_opens_in_the_past"}),
        (-2 * hour, day, {"opens_at": "race_opens_in_the_past"}),
        (hour, 367 * day, {"closes_at": "race_too_long"}),
        (800 * day, 801 * day, {"opens_at": "race_too_far_ahead"}),
    ):
        assert refusal(make, alice, now, opens_at=now + opens, closes_at=now + closes) == expected


def test_a_race_may_open_now_even_after_a_slow_form(alice, now):
    assert make(alice, now, opens_at=now - timedelta(minutes=10)).state_at(now) == RaceState.OPEN


def test_all_problems_are_reported_and_the_first_sets_the_code(alice, now):
    with pytest.raises(RaceRefused) as caught:
        make(alice, now, laps=3, minimum_laps=5, opens_at=now + timedelta(800), closes_at=now + timedelta(801))
    assert set(caught.value.errors.error_dict) == {"minimum_laps", "opens_at"}
    assert caught.value.code == "race_minimum_laps" and "3 consecutive laps" in str(caught.value)


def test_a_problem_without_its_own_code_still_names_the_field(alice, now):
    with pytest.raises(RaceRefused) as caught:
        make(alice, now, name="")
    assert caught.value.code == "race_field"
    assert caught.value.params["field"] == "name"


def test_a_refusal_uses_the_reason_of_a_problem_that_has_one(alice, now):
    with pytest.raises(RaceRefused) as caught:
        make(alice, now, sensors=[])
    assert caught.value.code == "race_sensors" and "FRONT_FACING_CAMERA" in str(caught.value)


def test_an_unknown_race_field_is_a_programming_error(alice, now):
    for wrong in ({"colour": "red"}, {"division": "pro"}, {"kind": "league"}, {"slug": "x"}):
        with pytest.raises(TypeError):
            make(alice, now, **wrong)


def test_a_racer_has_a_limited_number_of_unfinished_races(alice, bob, now, settings):
    settings.RACES_PER_RACER = 2
    make(alice, now)
    second = make(alice, now)
    with pytest.raises(UserFault) as caught:
        make(alice, now)
    assert (caught.value.code, caught.value.params) == ("race_limit", {"limit": 2})
    make(bob, now)
    cancel_race(race=second, reason="Nobody came.", now=now)
    make(alice, now)
    bob.is_staff = True
    bob.save()
    for _ in range(3):
        make(bob, now)


def test_league_races_are_public_and_have_a_division(now):
    league = {
        "name": "November",
        "track": a_track(),
        "opens_at": now - timedelta(days=14),
        "closes_at": now + timedelta(days=14),
        "now": now,
    }
    race = create_league_race(division="open", slug="2026-11-open", **league)
    assert (race.slug, race.organiser, race.state_at(now)) == ("2026-11-open", None, RaceState.OPEN)
    assert refusal(create_league_race, division="", **league) == {"division": "race_needs_division"}
    assert refusal(create_league_race, division="semi", **league) == {"division": "invalid_choice"}
    assert refusal(create_league_race, division="pro", visibility="invitation", **league) == {
        "visibility": "race_league_is_public"
    }
    assert refusal(create_league_race, division="open", slug="2026-11-open", **league) == {"slug": "unique"}


def test_before_the_first_submission_everything_can_be_changed(alice, bob, now):
    race = make(alice, now)
    enter_race(race=race, racer=bob, now=now)
    edit_race(race=race, now=now, laps=5, minimum_laps=5, ranking_method="total", direction="cw", name="Sunday sprint")
    stored = Race.objects.get()
    assert (stored.laps, stored.ranking_method, stored.direction, stored.name) == (5, "total", "cw", "Sunday sprint")
    assert stored.slug == "friday-sprint", "the address is stable"
    assert race.laps == 5


def test_the_first_submission_fixes_what_affects_results(alice, bob, now):
    race = make(alice, now, opens_at=now)
    submit_model(race=race, racer=bob, model=a_model(bob), now=now)
    for change in (
        {"laps": 5},
        {"ranking_method": "best"},
        {"off_track_penalty_ms": 1},
        {"direction": "cw"},
        {"seed": 9},
        {"max_resets": 1},
    ):
        assert refusal(edit_race, race=race, now=now, **change) == {next(iter(change)): "race_has_submissions"}
    edit_race(
        race=race,
        now=now,
        description="Come all!",
        max_submissions=9,
        visibility="invitation",
        closes_at=now + timedelta(days=9),
        laps=race.laps,
    )
    assert Race.objects.get().max_submissions == 9


def test_an_opened_race_keeps_its_opening_time(alice, now):
    race = make(alice, now)
    edit_race(race=race, now=now, opens_at=now + timedelta(hours=3))
    later = now + timedelta(hours=4)
    assert refusal(edit_race, race=race, now=later, opens_at=later + timedelta(hours=1)) == {
        "opens_at": "race_has_opened"
    }
    assert refusal(edit_race, race=race, now=later, closes_at=later) == {"closes_at": "race_already_over"}


def test_an_upcoming_race_cannot_move_into_the_past(alice, now):
    race = make(alice, now)
    assert refusal(edit_race, race=race, now=now, opens_at=now - timedelta(days=1)) == {
        "opens_at": "race_opens_in_the_past"
    }


def test_only_the_texts_of_a_finished_race_can_be_changed(alice, now):
    race = make(alice, now)
    over = race.closes_at
    assert refusal(edit_race, race=race, now=over, closes_at=over + timedelta(days=1)) == {"closes_at": "race_is_over"}
    assert refusal(edit_race, race=race, now=over, laps=5) == {"laps": "race_is_over"}
    edit_race(race=race, now=over, description="Thanks to all.")
    assert Race.objects.get().description == "Thanks to all."


def test_editing_a_permanent_field_is_a_programming_error(alice, now):
    race = make(alice, now)
    for wrong in ({"slug": "other"}, {"kind": "league"}, {"organiser": alice}, {"invitation": "x"}):
        with pytest.raises(TypeError):
            edit_race(race=race, now=now, **wrong)


def test_a_refused_change_leaves_the_instance_unchanged(alice, now):
    race = make(alice, now)
    refusal(edit_race, race=race, now=now, laps=2, minimum_laps=3)
    assert race.laps == 3 and Race.objects.get().laps == 3


def test_cancelling_stores_the_reason_and_stops_the_cars(alice, bob, charlie, now, django_capture_on_commit_callbacks):
    race = make(alice, now, opens_at=now)
    drive(race, charlie, laps(9_000, 9_000, 9_000), now)
    waiting = submit_model(race=race, racer=bob, model=a_model(bob), now=now).evaluation
    driving = start(submit_model(race=race, racer=alice, model=a_model(alice), now=now).evaluation, now)
    elsewhere = submit_model(race=a_race(now), racer=bob, model=a_model(bob), now=now).evaluation
    with django_capture_on_commit_callbacks(execute=True):
        cancel_race(race=race, reason="  The track\nis flooded. ", now=now)
    for evaluation in (waiting, driving, elsewhere):
        evaluation.refresh_from_db()
    assert (waiting.state, driving.state, elsewhere.state) == (State.STOPPED, State.STOPPED, State.QUEUED)
    race.refresh_from_db()
    assert (race.cancel_reason, race.cancelled_at) == ("The track is flooded.", now)
    assert race.state_at(now) == RaceState.CANCELLED
    assert race.entries.get(racer=charlie).classified, "what was driven stays to be read"


def test_a_race_is_cancelled_once_with_a_reason_before_its_end(alice, now):
    race = make(alice, now)
    assert refusal(cancel_race, race=race, reason=" ", now=now) == {"cancel_reason": "cancel_needs_a_reason"}
    with pytest.raises(UserFault, match="closed at"):
        cancel_race(race=race, reason="Too late.", now=race.closes_at)
    cancel_race(race=race, reason="Rain.", now=now)
    with pytest.raises(UserFault) as caught:
        cancel_race(race=race, reason="Rain again.", now=now)
    assert caught.value.code == "race_cancelled"
    assert refusal(edit_race, race=race, now=now, laps=5) == {"laps": "race_is_over"}


def test_resetting_the_invitation_keeps_the_members(alice, bob, charlie, now):
    race = make(alice, now, visibility=Visibility.INVITATION)
    old = race.invitation
    entry = accept_invitation(token=old, racer=bob, now=now)
    reset_invitation(race=race)
    with pytest.raises(UserFault) as caught:
        accept_invitation(token=old, racer=charlie, now=now)
    assert caught.value.code == "invitation_unknown"
    assert accept_invitation(token=race.invitation, racer=charlie, now=now).race == race
    entry.refresh_from_db()
    assert not entry.is_withdrawn


def test_an_invitation_ends_with_the_race(alice, bob, now):
    race = make(alice, now, visibility=Visibility.INVITATION)
    with pytest.raises(UserFault) as caught:
        accept_invitation(token=race.invitation, racer=bob, now=race.closes_at)
    assert caught.value.code == "race_closed"


def test_the_token_of_a_public_race_does_not_invite(alice, bob, now):
    race = make(alice, now)
    for token in (race.invitation, "", "nonsense"):
        with pytest.raises(UserFault, match="no longer valid"):
            accept_invitation(token=token, racer=bob, now=now)


def test_a_clone_is_the_same_race_a_month_later_without_entries(alice, bob, now):
    race = make(alice, now, laps=5, minimum_laps=2, ranking_method="best", visibility="invitation", description="Fun")
    accept_invitation(token=race.invitation, racer=bob, now=now)
    clone = clone_race(race=race, now=now)
    assert clone.pk != race.pk and clone.slug != race.slug and clone.invitation != race.invitation
    assert (clone.laps, clone.ranking_method, clone.visibility, clone.organiser) == (5, "best", "invitation", alice)
    assert clone.opens_at == datetime(2026, 12, 15, 13, 0, tzinfo=UTC)
    assert clone.closes_at == datetime(2026, 12, 17, 12, 0, tzinfo=UTC)
    assert not clone.entries.exists()


def test_a_clone_of_a_long_past_race_is_refused(now):
    race = a_race(now, opens_at=now - timedelta(days=90), closes_at=now - timedelta(days=80))
    refused = {"closes_at": "race_already_over", "opens_at": "race_opens_in_the_past"}
    assert refusal(clone_race, race=race, now=now) == refused


@pytest.mark.parametrize(
    ("day", "months", "expected"),
    [
        ((2026, 1, 31), 1, (2026, 2, 28)),
        ((2028, 1, 31), 1, (2028, 2, 29)),
        ((2026, 12, 1), 1, (2027, 1, 1)),
        ((2026, 11, 30), 14, (2028, 1, 30)),
        ((2026, 3, 31), -1, (2026, 2, 28)),
    ],
)
def test_months_are_calendar_months(day, months, expected):
    assert add_months(datetime(*day, 10, tzinfo=UTC), months).date() == datetime(*expected).date()


def test_months_keep_the_wall_clock_of_the_sites_time_zone(settings):
    settings.TIME_ZONE = "Europe/Berlin"
    timezone.get_default_timezone.cache_clear()
    try:
        first_of_march = datetime(2026, 2, 28, 23, 0, tzinfo=UTC)  # midnight in Berlin, winter time
        assert add_months(first_of_march, 1).astimezone(UTC) == datetime(2026, 3, 31, 22, 0, tzinfo=UTC)
    finally:
        timezone.get_default_timezone.cache_clear()


def test_races_offer_exactly_the_sensors_of_the_simulator():
    from paddock.simulator.sensors import SENSORS

    assert {*OFFERABLE, *SAME_AS} == set(SENSORS)
