"""Races of real cars: laps that were measured rank as laps that were simulated do, and arrive once."""

from __future__ import annotations

import itertools
import uuid
from dataclasses import replace
from datetime import timedelta

import pytest

from core.events import Event
from paddock.errors import UserFault
from races.boards.selectors.board import board
from races.entries.services.standings import recompute_race
from races.entries.services.submissions import submit_model
from races.live.services import plan_live
from races.models import Entry, MeasuredLap, RaceState, TimedSession, Timekeeper
from races.timing.selectors import can_keep_time
from races.timing.services import carry_over, choose_car, correct_lap, dismiss_timekeeper, name_timekeeper
from tests.factories import a_model, a_race, a_racer
from tests.races.timing import a_lap, a_physical_race, a_session, standing, timed

pytestmark = pytest.mark.django_db


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser)


def refused(code: str, work, **params) -> UserFault:
    """Do ``work`` and see it refused with this code, and nothing written."""
    before = [model.objects.order_by("pk").values_list() for model in (Entry, TimedSession, MeasuredLap)]
    before = [list(rows) for rows in before]
    with pytest.raises(UserFault) as caught:
        work()
    assert caught.value.code == code
    assert {name: caught.value.params.get(name) for name in params} == params
    assert before == [list(model.objects.order_by("pk").values_list()) for model in (Entry, TimedSession, MeasuredLap)]
    return caught.value


def test_a_measured_lap_ranks_with_its_penalties(race, organiser, now):
    alice, bob = a_racer("alice"), a_racer("bob")
    timed(race, alice, organiser, now, laps=[a_lap(1, 10_000, off_tracks=2), a_lap(2, 11_500)])
    timed(race, bob, organiser, now, 11_000)
    assert [(row.alias, row.rank, row.entry.score_ms) for row in board(race).rows] == [
        ("bob", 1, 11_000),
        ("alice", 2, 11_500),
    ]
    race.refresh_from_db()
    assert race.fastest_lap_ms == 11_000


@pytest.mark.parametrize(
    ("method", "needed", "laps", "score"),
    [
        ("best", 1, (12_000, 10_000, 11_000), 10_000),
        ("average", 2, (12_000, 10_000, 11_001), 10_500),
        ("total", 3, (12_000, 10_000, 11_000, 9_000), 33_000),
        ("average", 3, (12_000, 10_000), None),
    ],
)
def test_the_same_rules_rank_as_in_simulated_races(now, organiser, method, needed, laps, score):
    race = a_physical_race(now, organiser=organiser, ranking_method=method, laps=3, minimum_laps=needed)
    alice = a_racer("alice")
    timed(race, alice, organiser, now, *laps)
    assert standing(race, alice)[:2] == (score is not None, score)


def test_an_invalid_lap_breaks_the_row_and_too_many_resets_make_one(now, organiser):
    race = a_physical_race(now, organiser=organiser, ranking_method="average", minimum_laps=2, max_resets=1)
    alice = a_racer("alice")
    laps = [a_lap(1), a_lap(2, valid=False), a_lap(3), a_lap(4, resets=2), a_lap(5, 9_000), a_lap(6, 9_000, resets=1)]
    timed(race, alice, organiser, now, laps=laps)
    assert standing(race, alice)[:2] == (True, 9_000)


def test_the_best_session_counts_whichever_arrives_first(now, organiser):
    alice = a_racer("alice")
    found = set()
    for order in itertools.permutations(range(3)):
        race = a_physical_race(now, organiser=organiser)
        sent = [
            a_session(now, time, racer="alice", started_at=now - timedelta(minutes=30 - at))
            for at, time in enumerate((11_000, 10_000, 10_000))
        ]
        Entry.objects.create(race=race, racer=alice)
        for at in order:
            carry_over(race=race, by=organiser, sent=sent[at], now=now)
        entry = Entry.objects.get(race=race)
        found.add((entry.score_ms, entry.best_session_id == sent[1].id, entry.achieved_at, entry.submission_count))
    assert found == {(10_000, True, now - timedelta(minutes=29), 3)}


def test_sending_again_never_counts_twice(race, organiser, now):
    alice = a_racer("alice")
    Entry.objects.create(race=race, racer=alice)
    sent = a_session(now, 10_000, 11_000, racer="alice")
    for _ in range(3):
        carry_over(race=race, by=organiser, sent=sent, now=now)
    assert (TimedSession.objects.count(), MeasuredLap.objects.count()) == (1, 2)
    assert Entry.objects.get().submission_count == 1
    assert Event.objects.filter(kind="race.timed").count() == 1


def test_what_was_undone_later_goes_and_an_older_state_changes_nothing(race, organiser, now):
    alice = a_racer("alice")
    Entry.objects.create(race=race, racer=alice)
    first = a_session(now, 10_000, 9_000, racer="alice", ended=False)
    second = replace(first, revision=2, laps=first.laps[:1], ended=True)
    for sent in (second, first):
        carry_over(race=race, by=organiser, sent=sent, now=now)
    assert standing(race, alice)[1] == 10_000
    assert TimedSession.objects.get().revision == 2


def test_a_discarded_session_is_given_back(race, organiser, now):
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 10_000)
    sent = a_session(now, 10_000, racer="alice", id=session.pk, revision=2, discarded=True)
    for _ in range(2):
        carry_over(race=race, by=organiser, sent=sent, now=now)
    assert standing(race, alice)[:2] == (False, None)
    assert Entry.objects.get().submission_count == 0
    assert carry_over(race=race, by=organiser, sent=replace(sent, id=uuid.uuid4()), now=now) is None


def test_the_wrong_racer_is_put_right(race, organiser, now):
    alice, bob = a_racer("alice"), a_racer("bob")
    session = timed(race, alice, organiser, now, 10_000)
    Entry.objects.create(race=race, racer=bob)
    sent = a_session(now, 10_000, racer="bob", id=session.pk, revision=2)
    carry_over(race=race, by=organiser, sent=sent, now=now)
    assert standing(race, alice)[1] is None and standing(race, bob)[1] == 10_000
    assert dict(Entry.objects.values_list("racer__alias", "submission_count")) == {"alice": 0, "bob": 1}


def test_laps_driven_in_time_are_carried_over_after_the_race_has_closed(race, organiser, now):
    later = race.closes_at + timedelta(hours=47)
    sent = a_session(now, 10_000, racer="alice", started_at=race.closes_at - timedelta(seconds=1))
    Entry.objects.create(race=race, racer=a_racer("alice"))
    assert carry_over(race=race, by=organiser, sent=sent, now=later)
    again = replace(sent, id=uuid.uuid4())
    refused("timing_too_late", lambda: carry_over(race=race, by=organiser, sent=again, now=later + timedelta(hours=1)))


BAD = [
    ("lap_too_short", {"laps": [a_lap(1, 0)]}),
    ("lap_too_short", {"laps": [a_lap(1, 2999)]}),
    ("lap_too_short", {"laps": [a_lap(1, 0, valid=False)]}),
    ("lap_too_long", {"laps": [a_lap(1), a_lap(2, 365 * 86_400_000)]}),
    ("lap_clock", {"laps": [a_lap(1, 10_000, wall_ms=15_000)]}),
    ("lap_clock", {"laps": [a_lap(1, 10_000, wall_ms=-5_000)]}),
    ("lap_numbers", {"laps": [a_lap(1), a_lap(3)]}),
    ("lap_after_session", {"laps": [a_lap(1, 181_500), a_lap(2, 10_000)]}),
    ("timing_racer_unknown", {"racer": "nobody-here"}),
    ("timing_clock_ahead", {"ahead": timedelta(seconds=6)}),
    ("race_not_open_yet", {"ahead": -timedelta(days=2)}),
    ("race_closed", {"ahead": timedelta(days=7)}),
    ("guest_name", {"guest": (uuid.uuid4(), " \n ")}),
    ("guest_name", {"guest": (uuid.uuid4(), "=HYPERLINK()")}),
    ("sensor_unknown", {"sensor": 4711}),
]


@pytest.mark.parametrize(("code", "fields"), BAD, ids=[f"{at} {code}" for at, (code, _) in enumerate(BAD)])
def test_what_cannot_be_is_refused_whole(race, organiser, now, code, fields):
    Entry.objects.create(race=race, racer=a_racer("alice"))
    ahead = fields.get("ahead")
    extra = {name: value for name, value in fields.items() if name != "ahead"}
    if ahead is not None:
        extra["started_at"] = now + ahead
    sent = a_session(now, 10_000, **({"racer": "alice"} | extra))
    at = race.closes_at + timedelta(hours=1) if code == "race_closed" else now
    refused(code, lambda: carry_over(race=race, by=organiser, sent=sent, now=at))


def test_sessions_are_counted_against_the_limit_of_the_race(now, organiser):
    race = a_physical_race(now, organiser=organiser, max_submissions=1)
    alice = a_racer("alice")
    timed(race, alice, organiser, now, 10_000)
    sent = a_session(now, 9_000, racer="alice")
    refused("sessions_used_up", lambda: carry_over(race=race, by=organiser, sent=sent, now=now), limit=1)


def test_an_id_of_another_race_is_refused(race, organiser, now):
    other = a_physical_race(now, organiser=organiser)
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 10_000)
    Entry.objects.create(race=other, racer=alice)
    sent = a_session(now, 9_000, racer="alice", id=session.pk, revision=9)
    refused("timing_id_taken", lambda: carry_over(race=other, by=organiser, sent=sent, now=now))
    taken = a_lap(1)
    sent = a_session(now, racer="alice", laps=[replace(taken, id=session.laps.get().pk)])
    refused("timing_id_taken", lambda: carry_over(race=other, by=organiser, sent=sent, now=now))


def test_nothing_is_simulated_in_a_race_of_real_cars(race, now):
    alice = a_racer("alice")
    refused("race_is_physical", lambda: submit_model(race=race, racer=alice, model=a_model(alice), now=now))


def test_no_live_event_is_planned_for_real_cars(race, organiser, now):
    starts_at = now + timedelta(days=1)
    refused("live_of_real_cars", lambda: plan_live(race=race, by=organiser, now=now, starts_at=starts_at))


def test_nobody_takes_times_in_a_simulated_race(organiser, now):
    race = a_race(now, organiser=organiser)
    sent = a_session(now, 10_000, racer="alice")
    refused("race_not_physical", lambda: carry_over(race=race, by=organiser, sent=sent, now=now))


def test_a_race_worked_out_anew_stands_as_before(race, organiser, now):
    alice = a_racer("alice")
    timed(race, alice, organiser, now, 10_000, 9_500)
    before = Entry.objects.values().get()
    recompute_race(race=race)
    assert Entry.objects.values().get() == before


# --- who may ----------------------------------------------------------------------------------------------------------


def test_who_may_take_times(race, organiser, now):
    cast = {
        "organiser": organiser,
        "timekeeper": a_racer("tim"),
        "member": a_racer("alice"),
        "stranger": a_racer("zoe"),
        "staff": a_racer("boss", is_staff=True),
    }
    simulated = a_race(now, organiser=organiser)
    Entry.objects.create(race=race, racer=cast["member"])
    name_timekeeper(race=race, alias="TIM", by=organiser, now=now)
    may = {who for who, racer in cast.items() if can_keep_time(racer, race)}
    assert may == {"organiser", "timekeeper", "staff"}
    for who, racer in cast.items():
        assert not can_keep_time(racer, simulated), who
    assert not can_keep_time(None, race)
    for who in ("member", "stranger"):
        sent = a_session(now, 10_000, racer="alice")
        refused("timing_not_yours", lambda who=who, sent=sent: carry_over(race=race, by=cast[who], sent=sent, now=now))
    dismiss_timekeeper(race=race, racer=cast["timekeeper"], by=organiser)
    assert not can_keep_time(cast["timekeeper"], race)


def test_only_the_organiser_names_timekeepers(race, organiser, now):
    tim = a_racer("tim")
    refused("race_not_yours", lambda: name_timekeeper(race=race, alias="tim", by=tim, now=now))
    refused("timekeeper_unknown", lambda: name_timekeeper(race=race, alias="nobody-here", by=organiser, now=now))
    for _ in range(2):
        name_timekeeper(race=race, alias="tim", by=organiser, now=now)
    assert Timekeeper.objects.count() == 1
    lap = timed(race, a_racer("alice"), tim, now, 10_000).laps.get()
    refused("race_not_yours", lambda: correct_lap(lap=lap, by=tim, reason="x", now=now, valid=False))


def test_a_timekeeper_sees_a_race_by_invitation(organiser, now):
    from races.entries.selectors.visibility import can_see_race, races_visible_to

    race = a_physical_race(now, organiser=organiser, visibility="invitation")
    tim = a_racer("tim")
    assert not can_see_race(tim, race) and race not in races_visible_to(tim)
    name_timekeeper(race=race, alias="tim", by=organiser, now=now)
    assert can_see_race(tim, race) and race in races_visible_to(tim)


# --- corrections ------------------------------------------------------------------------------------------------------


def test_a_correction_keeps_what_stood_and_why(race, organiser, now):
    alice = a_racer("alice")
    lap = timed(race, alice, organiser, now, 10_000, 11_000).laps.get(number=1)
    made = correct_lap(lap=lap, by=organiser, reason=" cut \n the corner ", now=now, time_ms=10_500, off_tracks=1)
    assert (made.reason, made.before["time_ms"], made.after["time_ms"]) == ("cut the corner", 10_000, 10_500)
    assert standing(race, alice)[1] == 11_000 and standing(race, alice)[4] == 1
    correct_lap(lap=MeasuredLap.objects.get(pk=lap.pk), by=organiser, reason="no", now=now, valid=False)
    assert MeasuredLap.objects.get(pk=lap.pk).corrections.count() == 2


def test_a_corrected_lap_outlives_what_the_device_sends_again(race, organiser, now):
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 10_000, 11_000)
    lap = session.laps.get(number=1)
    correct_lap(lap=lap, by=organiser, reason="cut the corner", now=now, valid=False)
    again = [a_lap(1, 10_000), a_lap(2, 11_000), a_lap(3, 12_000)]
    again[0] = replace(again[0], id=lap.pk)
    sent = a_session(now, racer="alice", id=session.pk, revision=2, laps=again)
    carry_over(race=race, by=organiser, sent=sent, now=now)
    assert standing(race, alice)[1] == 11_000
    assert [(one.number, one.valid) for one in session.laps.order_by("number")] == [(1, False), (2, True), (3, True)]


@pytest.mark.parametrize(
    ("code", "fields"),
    [
        ("correction_needs_a_reason", {"reason": " ", "valid": False}),
        ("correction_changes_nothing", {"reason": "x", "valid": True}),
        ("lap_too_short", {"reason": "x", "time_ms": 0}),
        ("lap_too_long", {"reason": "x", "time_ms": 10**9}),
        ("lap_faults", {"reason": "x", "off_tracks": 1000}),
    ],
)
def test_a_bad_correction_changes_nothing(race, organiser, now, code, fields):
    lap = timed(race, a_racer("alice"), organiser, now, 10_000).laps.get()
    refused(code, lambda: correct_lap(lap=lap, by=organiser, now=now, **fields))


def test_a_closed_community_race_is_still_corrected_by_its_organiser(race, organiser, now):
    alice = a_racer("alice")
    lap = timed(race, alice, organiser, now, 10_000).laps.get()
    later = race.closes_at + timedelta(days=3)
    assert race.state_at(later) == RaceState.CLOSED
    correct_lap(lap=lap, by=organiser, reason="seen on the film", now=later, time_ms=10_001)
    assert standing(race, alice)[1] == 10_001


# --- the model on the car ---------------------------------------------------------------------------------------------


def test_a_racer_says_which_model_drives_their_car(race, organiser, now):
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 10_000)
    entry, mine, other = Entry.objects.get(racer=alice), a_model(alice), a_model(a_racer("bob"))
    refused("model_not_yours", lambda: choose_car(entry=entry, model=other, now=now))
    choose_car(entry=entry, model=mine, now=now)
    session.refresh_from_db()
    assert session.model == mine
    assert timed(race, alice, organiser, now, 9_000).model == mine
