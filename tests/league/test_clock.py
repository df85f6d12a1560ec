"""What comes by the passing of time is written down once."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.events import Event, follow
from league.models import Notice, Round
from league.seasons.services.clock import tick
from league.stewarding.official_results import close_round
from league.tasks import clock
from races.entries.services.submissions import submit_model
from races.models import Race
from tests.factories import a_model, a_race, a_racer, finish, laps
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db


def kinds() -> list[str]:
    return list(Event.objects.exclude(kind="race.board").order_by("pk").values_list("kind", flat=True))


def test_each_stage_of_a_race_is_announced_once(now):
    race = a_race(now, opens_at=now, closes_at=now + timedelta(days=5))
    for moment in (now - HOUR, now, now + HOUR, race.closes_at - HOUR, race.closes_at, race.closes_at + HOUR):
        tick(now=moment)
    assert kinds() == ["race.opened", "race.closing", "race.closed", "race.official"]
    at = dict(Event.objects.values_list("kind", "at"))
    assert (at["race.opened"], at["race.closed"]) == (race.opens_at, race.closes_at)


def test_a_postponed_race_opens_again_and_a_cancelled_one_does_not(now):
    race = a_race(now, opens_at=now)
    a_race(now, opens_at=now, cancelled_at=now, cancel_reason="Rain")
    assert tick(now=now) == 1
    Race.objects.filter(pk=race.pk).update(opens_at=now + HOUR)
    assert tick(now=now + HOUR) == 1 and kinds() == ["race.opened"] * 2


def test_a_race_becomes_official_when_its_last_car_is_timed(wakes, alice, now):
    race = a_race(now, closes_at=now + HOUR)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    tick(now=now + HOUR)
    assert "race.official" not in kinds()
    finish(submission, laps(9_000, 9_000, 9_000), now + 2 * HOUR)
    tick(now=now + 2 * HOUR)
    assert kinds()[-1] == "race.official"


def test_a_stopped_clock_catches_up_only_for_recent_days(now):
    a_race(now, opens_at=now, closes_at=now + timedelta(days=20))
    assert tick(now=now + timedelta(days=2)) == 1
    a_race(now, opens_at=now, closes_at=now + timedelta(days=20))
    assert tick(now=now + timedelta(days=4)) == 0
    assert clock() == 0


def test_closing_makes_a_round_official_and_notifies_its_racers():
    round_, cast = a_round(a_season(), 1, "open-qualifier"), racers(5)
    board(round_.race, cast)
    now = after(round_)
    tick(now=now)
    assert follow("seasons", now=now) == 1 and follow("seasons", now=now) == 0
    assert Round.objects.get().closed_at == now
    follow("notices", now=now)
    told = Notice.objects.filter(racer=cast[0]).order_by("pk").values_list("kind", flat=True)
    assert list(told) == ["promoted", "official"]


@pytest.mark.django_db(transaction=True)
def test_concurrent_clocks_and_readers_tell_each_thing_once(wakes, now):
    race = a_race(now, opens_at=now)
    board(race, [a_racer() for _ in range(3)])

    def look() -> int:
        tick(now=now)
        return follow("notices", now=now)

    answers = at_once([look] * 4)
    assert sum(answers) == 3, answers
    assert kinds() == ["race.opened"] and Notice.objects.count() == 3


@pytest.mark.django_db(transaction=True)
def test_a_killed_reader_tells_everything_once_next_time(monkeypatch):
    round_, cast = a_round(a_season(), 1, "open-qualifier"), racers(20)
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    now, told = after(round_), []
    manager = type(Notice.objects)
    written = manager.bulk_create

    def until_killed(notices, rows, **options):
        if notices.model is not Notice:
            return written(notices, rows, **options)
        told.append(rows)
        made = written(notices, rows, **options)
        if len(told) % 2 == 0:
            raise KeyboardInterrupt  # after it was written, before it is committed
        return made

    monkeypatch.setattr(manager, "bulk_create", until_killed)
    kills = 0
    while True:
        try:
            follow("notices", now=now)
            break
        except KeyboardInterrupt:
            kills += 1
    assert kills == 4 and len(told) == 9, "each of the last four once in vain"
    assert [Notice.objects.filter(kind=kind).count() for kind in ("promoted", "official")] == [4, 20]
