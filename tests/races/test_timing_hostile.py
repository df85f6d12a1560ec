"""What comes in from outside and cannot be: a reason each, and nothing else is changed."""

from __future__ import annotations

import csv
import re
import uuid

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.urls import reverse

from races.models import Crossing, Entry, Guest, MeasuredLap, TimedSession
from races.timing.services import carry_over, correct_lap, make_sensor, revoke_sensor, take_file
from races.timing.services.files import lap_lines
from tests.factories import a_model, a_racer
from tests.races.test_timing import refused
from tests.races.timing import a_physical_race, a_session, timed

pytestmark = pytest.mark.django_db
YEAR_MS = 365 * 86_400_000


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, slug="real-race", organiser=organiser)


def everything() -> list:
    """What is kept of times."""
    return [list(each.objects.order_by("pk").values_list()) for each in (Entry, Guest, TimedSession, MeasuredLap)]


@pytest.mark.parametrize(("code", "time_ms"), [("lap_too_short", 0), ("lap_too_long", YEAR_MS)])
def test_no_way_in_takes_a_lap_of_nothing_or_of_a_year(race, organiser, now, code, time_ms):
    lap = timed(race, a_racer("alice"), organiser, now, 10_000).laps.get()
    before = everything()
    sent = a_session(now, 9_000, time_ms, racer="alice")
    refused(code, lambda: carry_over(race=race, by=organiser, sent=sent, now=now))
    refused(code, lambda: correct_lap(lap=lap, by=organiser, reason="Typed", now=now, time_ms=time_ms))
    assert everything() == before


@pytest.mark.parametrize("name", ["\0", "\0\n\t", "=1+1", "@SUM(A1)", "x" * 65])
def test_a_name_that_is_none_makes_no_guest(race, organiser, now, name):
    sent = a_session(now, 9_000, guest=(uuid.uuid4(), name))
    refused("guest_name", lambda: carry_over(race=race, by=organiser, sent=sent, now=now))
    assert not Entry.objects.exists() and not Guest.objects.exists()


def test_a_nul_in_names_is_left_out(race, organiser, now):
    sent = a_session(now, 9_000, guest=(uuid.uuid4(), "Mi\0a"), car="Car\0 7")
    carry_over(race=race, by=organiser, sent=sent, now=now)
    assert (Guest.objects.get().name, TimedSession.objects.get().car) == ("Mia", "Car 7")


def test_a_spreadsheet_runs_nothing_of_an_export(race, organiser, now):
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 9_000)
    model = a_model(alice)
    type(model).objects.filter(pk=model.pk).update(name='=HYPERLINK("http://x.example";"win")')
    TimedSession.objects.filter(pk=session.pk).update(model=model, car="+1")
    (row,) = csv.DictReader(lap_lines(race))
    assert row["model"].startswith("'=HYPERLINK") and row["car"] == "'+1"
    assert not [cell for cell in row.values() if cell.startswith(("=", "+", "-", "@"))]


def test_an_alias_that_looks_like_a_formula_comes_back(race, organiser, now):
    timed(race, a_racer("-dash"), organiser, now, 9_000)
    text = "".join(lap_lines(race))
    assert "'-dash" in text
    before = everything()
    assert take_file(race=race, by=organiser, text=text, now=now) == 1 and everything() == before


def test_a_formula_in_a_file_of_laps_is_refused(race, organiser, now):
    text = "guest,lap,time\n\"=cmd|' /C calc'!A0\",1,12.5\n"
    fault = refused("timing_file", lambda: take_file(race=race, by=organiser, text=text, now=now))
    assert [one.fault.code for one in fault.problems] == ["guest_name"]
    assert not Entry.objects.exists()


@pytest.mark.parametrize("content", [b"guest,lap,time\n" + b"Fred,1,12.5\n" * 870_000, b"\0\xff\xfe" * 100, b""])
def test_a_huge_or_broken_file_is_told_on_the_page(race, organiser, now, client, content):
    client.force_login(organiser)
    sent = {"do": "file", "file": SimpleUploadedFile("laps.csv", content, "text/csv")}
    answer = client.post(reverse("race_timing_setup", args=[race.slug]), sent)
    assert answer.status_code in (413, 422) and not Entry.objects.exists()


def test_who_holds_a_revoked_token_is_told_so_and_times_nothing(race, organiser, now, client):
    sensor, token = make_sensor(race=race, name="Gate", by=organiser, now=now)
    revoke_sensor(sensor=sensor, by=organiser, now=now)
    for text, code in ((token, "sensor_revoked"), ("pds_nothing", "sensor_token")):
        headers = {"HTTP_AUTHORIZATION": f"Bearer {text}"}
        address = "/api/v1/timing/crossings/"
        answer = client.post(address, {"number": 1, "at_ms": 0}, content_type="application/json", **headers)
        assert answer.status_code in (401, 403) and code in answer.content.decode(), answer.content
    assert not Crossing.objects.exists()


def test_the_browser_keeps_every_file_of_the_timekeepers_page(race, organiser, client):
    """Else the page comes without a network in pieces."""
    client.force_login(organiser)
    page = client.get(reverse("race_timing", args=[race.slug])).content.decode()
    named = set(re.findall(r'(?:href|src)="(/static/[^"]+\.(?:css|js|svg))"', page))
    worker = client.get(reverse("race_timing_worker", args=[race.slug])).content.decode()
    assert len(named) > 10 and {file for file in named if file.replace("-", "\\u002D") not in worker} == set()
