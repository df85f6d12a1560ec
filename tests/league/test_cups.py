"""Cups of the day: what the clock does of itself, who meets whom, and what is left of it."""

from __future__ import annotations

from datetime import datetime, time, timedelta
from zoneinfo import ZoneInfo

import pytest

from core.events import Event
from evaluation.models import Evaluation, State
from league.cups.rules import divisions, drawn_ground, next_start
from league.cups.selectors import cup_now, most_trophies, recap_of, stage_of, trophies_of
from league.cups.services import run_cups, start_always, start_no_more
from league.models import Cup, CupDivision, CupPlace
from paddock.errors import UserFault
from races.duels.services import drive_all_on
from races.entries.services.submissions import submit_model
from races.models import Entry, Submission
from races.pages.services import cancel_race
from tests.duels import driving, end, seeds
from tests.factories import a_model, a_racer, finish, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db
SEOUL = ZoneInfo("Asia/Seoul")


class TestTheRules:
    def test_the_next_start_is_the_next_time_the_clock_says_so(self):
        before = datetime(2026, 11, 26, 19, 59, tzinfo=SEOUL)
        assert next_start(time(20), SEOUL, before) == datetime(2026, 11, 26, 20, tzinfo=SEOUL)
        assert next_start(time(20), SEOUL, before + timedelta(minutes=1)) == datetime(2026, 11, 27, 20, tzinfo=SEOUL)

    def test_an_hour_that_is_left_out_is_the_one_after_it(self):
        berlin = ZoneInfo("Europe/Berlin")
        found = next_start(time(2, 30), berlin, datetime(2026, 3, 29, 0, tzinfo=berlin))
        assert found.astimezone(berlin).time() == time(3, 30)

    def test_a_day_draws_the_same_ground_for_everybody_and_none_of_the_last(self):
        tracks = ["oval", "loop", "turnpike"]
        assert drawn_ground("2026-11-26", tracks, []) == drawn_ground("2026-11-26", tracks[::-1], [])
        assert {drawn_ground(f"2026-11-{day:02}", tracks, ["oval", "loop"])[0] for day in range(1, 31)} == {"turnpike"}
        assert {drawn_ground(f"2026-11-{day:02}", tracks, tracks)[0] for day in range(1, 31)} == set(tracks)
        assert {drawn_ground(f"2026-11-{day:02}", tracks, [])[1] for day in range(1, 31)} == {"ccw", "cw"}

    @pytest.mark.parametrize(
        ("cars", "sizes"), [(0, []), (1, []), (2, [2]), (16, [16]), (17, [17]), (18, [16, 2]), (50, [16, 16, 16, 2])]
    )
    def test_nobody_is_alone_in_a_division(self, cars, sizes):
        assert [len(one) for one in divisions(cars)] == sizes
        assert [place for one in divisions(cars) for place in one] == list(range(cars if cars > 1 else 0))


@pytest.fixture
def at_eight(settings):
    settings.CUP_TIME, settings.TIME_ZONE = "20:00", "UTC"
    track_row("oval")


EVENING = datetime(2026, 11, 26, 20, tzinfo=ZoneInfo("UTC"))


def announced() -> Cup:
    run_cups(now=EVENING - timedelta(hours=2))
    return Cup.objects.select_related("race__track").get()


def qualified(cup: Cup, count: int) -> None:
    """So many racers send a car while it is open; the first of them is the fastest."""
    for number in range(count):
        racer = a_racer(f"car-{number + 1}")
        sent = submit_model(race=cup.race, racer=racer, model=a_model(racer), now=EVENING + timedelta(minutes=1))
        finish(sent, laps(*[9000 + 100 * number] * 3), EVENING + timedelta(minutes=2))


def run_out(now: datetime) -> datetime:
    """Let the clock and the workers do what is due until nothing happens any more; the time then."""
    for _ in range(200):
        taken = run_cups(now=now)
        for sent in Submission.objects.filter(evaluation__state=State.QUEUED).select_related("entry__race"):
            first = Entry.objects.get(race__cup__divisions__race=sent.entry.race, racer=sent.entry.racer)
            finish(sent, laps(*[first.best_lap_ms] * 3), now)
            taken += 1
        drive_all_on(now=now)
        for division in CupDivision.objects.select_related("race"):
            for duel in driving(division.race):
                best = min(seeds(duel))
                end(duel, now, winners=[best, *(seed for seed in seeds(duel) if seed != best)])
                taken += 1
            drive_all_on(now=now)
        if not taken and not Cup.objects.filter(over_at=None, day=EVENING.date()).exists():
            return now
        now += timedelta(seconds=20)
    raise AssertionError("it does not end")


def test_it_is_announced_twenty_hours_ahead_and_once(at_eight):
    assert run_cups(now=EVENING - timedelta(hours=21)) == 0
    assert run_cups(now=EVENING - timedelta(hours=20)) == 1
    assert run_cups(now=EVENING - timedelta(hours=19)) == 0
    cup = Cup.objects.get()
    assert (cup.day.isoformat(), cup.race.opens_at) == ("2026-11-26", EVENING)
    assert cup.race.closes_at == EVENING + timedelta(minutes=15)
    assert cup_now(EVENING) == cup and stage_of(cup, EVENING) == "qualifying"


def test_without_a_time_there_is_none(at_eight, settings):
    settings.CUP_TIME = ""
    assert run_cups(now=EVENING) == 0 and not Cup.objects.exists()


def test_without_a_track_there_is_none(settings):
    settings.CUP_TIME = "20:00"
    assert run_cups(now=EVENING) == 0 and not Cup.objects.exists()


def test_a_standing_entry_starts_by_itself_and_once(at_eight):
    racer = a_racer("early")
    start_always(racer=racer, model=a_model(racer), now=EVENING - timedelta(days=3))
    left = a_racer("left")
    start_always(racer=left, model=a_model(left), now=EVENING - timedelta(days=3))
    start_no_more(racer=left)
    cup = announced()
    assert run_cups(now=EVENING) == 1
    assert run_cups(now=EVENING + timedelta(seconds=20)) == 0
    assert list(Submission.objects.values_list("entry__racer__alias", "entry__race")) == [("early", cup.race.pk)]


def test_whoever_sent_a_car_or_withdrew_is_left_alone(at_eight):
    cup = announced()
    sent, gone = a_racer("sent"), a_racer("gone")
    for racer in (sent, gone):
        start_always(racer=racer, model=a_model(racer), now=EVENING)
    submit_model(race=cup.race, racer=sent, model=a_model(sent), now=EVENING)
    Entry.objects.create(race=cup.race, racer=gone, entered_at=EVENING, withdrawn_at=EVENING)
    assert run_cups(now=EVENING) == 0


def test_a_model_of_somebody_else_cannot_start(at_eight):
    with pytest.raises(UserFault) as refused:
        start_always(racer=a_racer(), model=a_model(a_racer()), now=EVENING)
    assert refused.value.code == "model_not_yours"


def test_a_cup_goes_from_its_announcement_to_its_winners_by_itself(at_eight):
    cup = announced()
    qualified(cup, 5)
    run_out(EVENING + timedelta(minutes=15))
    cup.refresh_from_db()
    assert cup.over_at is not None
    places = list(cup.places.values_list("division", "place", "racer__alias", "qualified"))
    assert [place[2] for place in places[:2]] == ["car-1", "car-2"]
    assert sorted(place[3] for place in places) == [1, 2, 3, 4, 5]
    winner = Entry.objects.get(race=cup.race, racer__alias="car-1").racer
    assert [won.cup for won in trophies_of(winner)] == [cup]
    assert most_trophies()[0].alias == "car-1"
    told = recap_of(cup)
    assert told.fastest is not None and told.fastest.racer.alias == "car-1"
    assert told.closest is not None
    assert Event.objects.filter(kind="cup.over").count() == 1


@pytest.mark.slow
def test_racers_meet_those_of_their_own_pace(at_eight):
    cup = announced()
    qualified(cup, 20)
    run_out(EVENING + timedelta(minutes=15))
    fields = {
        division.number: set(Entry.objects.filter(race=division.race).values_list("racer__alias", flat=True))
        for division in cup.divisions.all()
    }
    assert fields == {1: {f"car-{n}" for n in range(1, 17)}, 2: {f"car-{n}" for n in range(17, 21)}}
    assert CupPlace.objects.get(cup=cup, division=2, place=1).racer.alias == "car-17"


def test_a_knock_out_is_for_those_who_were_drawn(at_eight):
    cup = announced()
    qualified(cup, 2)
    now = EVENING + timedelta(minutes=15)
    run_cups(now=now)
    stranger = a_racer("stranger")
    with pytest.raises(UserFault) as refused:
        submit_model(race=cup.divisions.get().race, racer=stranger, model=a_model(stranger), now=now)
    assert refused.value.code == "cup_not_drawn"


def test_it_is_not_drawn_before_the_last_car_is_timed(at_eight):
    cup = announced()
    qualified(cup, 2)
    late = a_racer("late")
    sent = submit_model(race=cup.race, racer=late, model=a_model(late), now=EVENING + timedelta(minutes=14))
    now = EVENING + timedelta(minutes=16)
    assert run_cups(now=now) == 0
    finish(sent, laps(8000, 8000, 8000), now)
    assert run_cups(now=now) == 1
    assert Entry.objects.filter(race=cup.divisions.get().race).count() == 3


@pytest.mark.parametrize("count", [0, 1])
def test_a_cup_of_nobody_or_one_ends_without_a_heat(at_eight, count):
    cup = announced()
    qualified(cup, count)
    run_cups(now=EVENING + timedelta(minutes=15))
    cup.refresh_from_db()
    assert cup.over_at is not None
    assert [place.racer.alias for place in cup.places.all()] == ["car-1"][:count]
    assert not Evaluation.objects.filter(state=State.QUEUED).exists()


def test_a_cancelled_cup_is_over_without_winners(at_eight):
    cup = announced()
    cancel_race(race=cup.race, reason="No power.", now=EVENING)
    run_cups(now=EVENING)
    cup.refresh_from_db()
    assert cup.over_at is not None and stage_of(cup, EVENING) == "cancelled"
    assert not Event.objects.filter(kind="cup.over").exists()


def test_a_cancelled_knock_out_does_not_hold_up_its_cup(at_eight):
    cup = announced()
    qualified(cup, 18)
    now = EVENING + timedelta(minutes=15)
    run_cups(now=now)
    cancel_race(race=cup.divisions.get(number=1).race, reason="The track is wet.", now=now)
    run_out(now)
    cup.refresh_from_db()
    assert cup.over_at is not None
    assert cup.places.filter(division=2).count() == 2
    assert not cup.places.filter(division=1).exists(), "a cancelled knock-out has no winner"
    assert stage_of(cup, now) == "over"


def test_a_cup_that_fails_does_not_keep_the_next_one_waiting(at_eight, monkeypatch):
    cup = announced()
    monkeypatch.setattr("league.cups.services._draw", lambda cup, now: 1 / 0)
    later = EVENING + timedelta(hours=5)
    run_cups(now=later)
    assert Cup.objects.exclude(pk=cup.pk).exists()
    monkeypatch.undo()
    run_cups(now=later)
    cup.refresh_from_db()
    assert cup.over_at is not None


def test_the_same_step_twice_is_one(at_eight):
    cup = announced()
    qualified(cup, 3)
    now = EVENING + timedelta(minutes=15)
    run_cups(now=now)
    run_cups(now=now)
    assert cup.divisions.count() == 1


@pytest.mark.soak
def test_a_year_of_cups_needs_nobody(at_eight):
    """365 evenings of four standing entries: a cup each, all over, no place twice, every track in its turn."""
    for slug in ("baja-turnpike", "kuei-raceway", "cosmic-loop"):
        track_row(slug)
    racers = [a_racer(f"car-{number}") for number in range(1, 5)]
    for racer in racers:
        start_always(racer=racer, model=a_model(racer), now=EVENING - timedelta(days=1))
    start = EVENING - timedelta(hours=2)
    for day in range(365):
        now = start + timedelta(days=day)
        run_cups(now=now)
        now += timedelta(hours=2)
        run_cups(now=now)
        for number, sent in enumerate(Submission.objects.filter(evaluation__state=State.QUEUED).order_by("pk")):
            finish(sent, laps(*[9000 + 100 * ((number + day) % 4)] * 3), now)
        _run_a_night(now + timedelta(minutes=15))
    assert Cup.objects.filter(over_at__isnull=False).count() == 365
    assert CupPlace.objects.count() == 4 * 365
    assert {won.alias for won in most_trophies()} == {racer.alias for racer in racers}


def _run_a_night(now: datetime) -> None:
    for _ in range(60):
        run_cups(now=now)
        for sent in Submission.objects.filter(evaluation__state=State.QUEUED).select_related("entry__race"):
            first = Entry.objects.get(race__cup__divisions__race=sent.entry.race, racer=sent.entry.racer)
            finish(sent, laps(*[first.best_lap_ms] * 3), now)
        drive_all_on(now=now)
        for division in CupDivision.objects.filter(cup__over_at=None).select_related("race"):
            for duel in driving(division.race):
                best = min(seeds(duel))
                end(duel, now, winners=[best, *(seed for seed in seeds(duel) if seed != best)])
            drive_all_on(now=now)
        if not Cup.objects.filter(over_at=None, race__closes_at__lte=now).exists():
            return
        now += timedelta(seconds=20)
    raise AssertionError("it does not end")
