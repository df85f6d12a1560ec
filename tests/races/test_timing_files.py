"""Laps from a CSV file and into one: all or nothing, errors by line, and the same file twice is the same."""

from __future__ import annotations

import pytest

from races.models import Entry, MeasuredLap, TimedSession
from races.timing.services import take_file
from races.timing.services.files import FileRefused, lap_lines
from tests.factories import a_racer
from tests.races.test_timing import refused
from tests.races.timing import a_physical_race, standing, timed

pytestmark = pytest.mark.django_db
FILE = """racer,lap,time,off tracks,valid
alice,1,0:12.345,1,1
alice,2,11.5,0,yes
bob,1,10,,
bob,2,9.999,0,0
"""


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser)


@pytest.fixture
def racers(race):
    both = [a_racer("alice"), a_racer("bob")]
    for racer in both:
        Entry.objects.create(race=race, racer=racer)
    return both


def rows() -> list[tuple]:
    order = ("session__entry__racer__alias", "number")
    return list(MeasuredLap.objects.order_by(*order).values_list(*order, "time_ms", "off_tracks", "valid"))


def test_laps_of_a_file_rank(race, organiser, racers, now):
    assert take_file(race=race, by=organiser, text=FILE, now=now) == 4
    assert rows() == [
        ("alice", 1, 12_345, 1, True),
        ("alice", 2, 11_500, 0, True),
        ("bob", 1, 10_000, 0, True),
        ("bob", 2, 9_999, 0, False),
    ]
    assert [standing(race, one)[1] for one in racers] == [11_500, 10_000]


def test_the_same_file_twice_is_the_same_and_a_better_one_replaces_it(race, organiser, racers, now):
    for _ in range(2):
        take_file(race=race, by=organiser, text=FILE, now=now)
    assert TimedSession.objects.count() == 2 and len(rows()) == 4
    take_file(race=race, by=organiser, text=FILE.replace("11.5,", "11.4,"), now=now)
    assert standing(race, racers[0])[1] == 11_400 and Entry.objects.get(racer=racers[0]).submission_count == 1


def test_what_is_exported_comes_back(race, organiser, racers, now):
    take_file(race=race, by=organiser, text=FILE + "bob,3,8.5,0,1\n", now=now)
    timed(race, racers[0], organiser, now, 9_000, 9_100)
    text = "".join(lap_lines(race))
    before = rows(), list(Entry.objects.order_by("pk").values_list())
    take_file(race=race, by=organiser, text=text, now=now)
    assert (rows(), list(Entry.objects.order_by("pk").values_list())) == before
    changed = text.replace(",9000,", ",8000,").replace("0:09.000", "0:08.000")
    assert changed != text
    fault = refused("timing_file", lambda: take_file(race=race, by=organiser, text=changed, now=now))
    assert [one.fault.code for one in fault.problems] == ["csv_session_known"]


def test_guests_come_by_name(race, organiser, now):
    text = "session,guest,lap,time\n1,Mia,1,12\n1,mia,2,11\n2,Mia,1,10\n"
    take_file(race=race, by=organiser, text=text, now=now)
    take_file(race=race, by=organiser, text=text, now=now)
    entry = Entry.objects.get()
    assert (entry.guest_name, entry.score_ms, entry.submission_count) == ("Mia", 10_000, 2)


BAD = [
    ("racer,lap,time\nalice,1,0\n", [(2, "lap_too_short")]),
    ("racer,lap,time\nalice,1,99999999.1\n", [(2, "csv_time")]),
    ("racer,lap,time\nalice,1,525600:00\n", [(2, "csv_time")]),
    ("racer,lap,time\nalice,1,1200.001\n", [(2, "lap_too_long")]),
    ("racer,lap,time\nalice,1,0:61\n", [(2, "csv_time")]),
    ("racer,lap,time\nalice,1,12\nnobody-here,1,12\n", [(3, "timing_racer_unknown")]),
    ("racer,lap,time\nalice,1,12\nalice,3,12\n", [(2, "lap_numbers")]),
    ("racer,lap,time\nalice,one,12\nalice,2,x\n", [(2, "csv_number"), (3, "csv_time")]),
    ("racer,lap,time,valid\nalice,1,12,maybe\n", [(2, "csv_valid")]),
    ("racer,lap,time\nalice,1\n", [(2, "csv_cells")]),
    ("racer,lap,time\n,1,12\n", [(2, "csv_who")]),
    ("racer,lap,speed\nalice,1,12\n", [(1, "csv_heading")]),
    ("", [(1, "csv_heading")]),
    ("racer,lap,time\n", [(1, "csv_empty")]),
    ('racer,lap,time\n"alice,1,12\n', [(2, "csv_form")]),
    ("racer,lap,time,started_at\nalice,1,12,yesterday\n", [(2, "csv_moment")]),
    ("racer,lap,time,started_at\nalice,1,12,2020-01-01T00:00:00Z\n", [(2, "race_not_open_yet")]),
    ("racer,lap,time\n" + "alice,1,12\n" * 5001, [(5002, "csv_too_long")]),
    ("x" * 1_000_001, [(1, "csv_too_large")]),
]


@pytest.mark.parametrize(("text", "told"), BAD, ids=[f"{at} {told[0][1]}" for at, (_, told) in enumerate(BAD)])
def test_a_bad_file_is_refused_whole_line_by_line(race, organiser, racers, now, text, told):
    fault = refused("timing_file", lambda: take_file(race=race, by=organiser, text=text, now=now))
    assert isinstance(fault, FileRefused)
    assert [(one.line, one.fault.code) for one in fault.problems] == told


def test_only_the_organiser_takes_a_file(race, racers, now):
    refused("race_not_yours", lambda: take_file(race=race, by=racers[0], text=FILE, now=now))
