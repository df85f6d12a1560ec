"""What pages, the API and the operators' commands say while a race is being repeated with another engine."""

from __future__ import annotations

from datetime import timedelta
from io import StringIO

import pytest
from django.conf import settings
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone

from evaluation.running.worker_nodes import start_worker
from paddock.errors import PlatformFault
from races.entries.services.redrives import sweep_redrives
from races.models import Race
from races.tasks import redrives as task
from tests.factories import a_race, a_racer, drive, laps
from tests.redrives import SITE, break_down, end, pending

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("wakes")]
OLD, NEW = "engine-of-before", "engine-of-now"


@pytest.fixture
def race(monkeypatch) -> Race:
    """A race of ann and bob that the sweep has begun to drive again; ann's run is done."""
    now = timezone.now()
    monkeypatch.setattr(SITE, OLD)
    race = a_race(now, name="Night Race")
    for name, time_ms in (("ann", 10_000), ("bob", 11_000)):
        drive(race, a_racer(name), laps(*[time_ms] * 3), now)
    monkeypatch.setattr(SITE, NEW)
    assert task() == 2
    end(pending(race)[0], laps(12_000, 12_000, 12_000), now)
    return race


def page(address: str, reader=None) -> str:
    client = Client()
    if reader is not None:
        client.force_login(reader, backend="django.contrib.auth.backends.ModelBackend")
    answer = client.get(address)
    assert answer.status_code == 200
    return answer.content.decode()


def switch(race: Race) -> None:
    now = timezone.now()
    for one in pending(race)[1:]:
        end(one, laps(11_000, 11_000, 11_000), now)
    sweep_redrives(now=now)


def doctor() -> str:
    out = StringIO()
    call_command("doctor", stdout=out)
    return out.getvalue()


def test_the_race_page_shows_progress_and_viewing_changes_nothing(race):
    html = page(race.get_absolute_url())
    assert f"being repeated with the engine {NEW}" in html and "1 of 2 runs done" in html
    assert "0:10.000" in html and "0:12.000" not in html
    switch(race)
    html = page(race.get_absolute_url())
    assert "driven-again" not in html and "0:12.000" in html


def test_the_rules_and_the_api_name_the_engine(race):
    rules = page(f"{race.get_absolute_url()}rules/")
    assert f"{OLD} (being repeated with {NEW})" in rules
    found = Client().get(f"/api/v1/races/{race.slug}/").json()
    assert (found["engine"], found["next_engine"]) == (OLD, NEW)
    switch(race)
    found = Client().get(f"/api/v1/races/{race.slug}/").json()
    assert (found["engine"], found["next_engine"]) == (NEW, "")


def test_a_run_sent_during_a_redrive_says_when_it_counts(race):
    sent = drive(race, a_racer("cat"), laps(9_000, 9_000, 9_000), timezone.now())
    html = page(sent.evaluation.get_absolute_url(), sent.evaluation.owner)
    assert "It counts when the other runs of this race have been repeated" in html
    html = page(race.get_absolute_url(), sent.evaluation.owner)
    assert "It counts when the other runs of this race have been repeated" in html


def test_a_run_of_the_old_engine_links_to_the_one_that_counts(race):
    old = race.entries.get(racer__alias="ann").best.evaluation
    switch(race)
    new = race.entries.get(racer__alias="ann").best.evaluation
    html = page(old.get_absolute_url(), old.owner)
    assert f'<a href="{new.get_absolute_url()}">' in html and "0:10.000" in html
    home = page("/", old.owner)
    assert new.get_absolute_url() in home and old.get_absolute_url() not in home
    with pytest.raises(CommandError) as told:
        call_command("verify", old.public_id)
    assert told.value.returncode == 3
    assert OLD in str(told.value) and f"{new.public_id} counts since, of {NEW}" in str(told.value)


def test_the_doctor_shows_redrives_and_what_blocks_them(race):
    html = page("/workers/", a_racer("boss", is_staff=True, is_superuser=True))
    assert "driven-again" in html and "1 of 2" in html and f"{OLD} → {NEW}" in html
    assert f"driven again with {NEW}: 1 of 2 runs done" in doctor()
    failing = pending(race)[1]
    break_down(failing, PlatformFault("internal_error"), timezone.now())
    assert f"{failing.evaluation} has failed {settings.EVALUATION_MAX_ATTEMPTS} times" in doctor()


def test_the_doctor_names_workers_with_an_old_engine(race, monkeypatch):
    monkeypatch.setattr(SITE, OLD)
    start_worker(name="left behind", queues=["celery"], processes=1, now=timezone.now() - timedelta(seconds=5))
    monkeypatch.setattr(SITE, NEW)
    assert f"live workers still drive with {OLD}" in doctor()


def test_the_doctor_says_when_nothing_is_driven_again():
    assert "none is being driven again" in doctor()
