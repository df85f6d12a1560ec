"""The public status page, its twin in the API, and the page of what needs a hand."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.models import Racer
from accounts.programs.services import make_program
from config.operations import status
from config.operations.health import Readiness
from evaluation.models import Damage, Evaluation, StoredFile, WorkerNode
from league.seasons.services.seasons import create_season
from races.models import ServiceDay
from races.test_runs.services import drive_own
from tests.clients import logged_in
from tests.factories import a_model, a_racer, a_track

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def works(monkeypatch) -> dict[str, bool]:
    parts = {name: True for name in status.PARTS if name != "web"}
    monkeypatch.setattr(status, "readiness", lambda: Readiness(parts))
    return parts


def waiting(seconds: int) -> Evaluation:
    racer = a_racer(f"waits{seconds}")
    run = drive_own(owner=racer, model=a_model(racer), track=a_track(), now=timezone.now()).evaluation
    Evaluation.objects.filter(pk=run.pk).update(queued_at=timezone.now() - timedelta(seconds=seconds))
    return run


def days(count: int) -> None:
    today = timezone.now().date()
    for back in range(count):
        ServiceDay.objects.create(
            day=today - timedelta(days=back), runs=9, p50_ms=2_000 + back, p95_ms=9_000, faults=back, given_back=1
        )


def test_guests_see_what_waits_what_is_stuck_and_the_days(wakes):
    waiting(5), waiting(90)
    days(30)
    page = Client().get("/status/")
    shown = page.context["status"]
    assert (shown.waiting, shown.stuck, shown.running, len(shown.days)) == (2, 1, 0, 30)
    html = page.content.decode()
    assert html.count("chart-point") == 60 and 'role="img"' in html
    assert "0:02.000" in html and "0:09.000" in html
    assert "Results are delayed." in html


def test_a_part_that_does_not_work_is_named(works):
    assert "Everything works." in Client().get("/status/").content.decode()
    works["broker"] = False
    html = Client().get("/status/").content.decode()
    assert html.count("does not work</span>") == 1 and "Something does not work." in html


def test_the_api_says_the_same(wakes, works):
    waiting(90)
    days(2)
    works["storage"] = False
    answer = Client().get("/api/v1/status/").json()
    assert (answer["well"], answer["stuck"], answer["waiting"]) == (False, 1, 1)
    assert answer["parts"]["storage"] is False and answer["parts"]["web"] is True
    assert [day["runs"] for day in answer["days"]] == [9, 9]


def test_the_page_needs_as_many_queries_for_many_rows_as_for_few(wakes):
    def queries() -> int:
        with CaptureQueriesContext(connection) as captured:
            assert Client().get("/status/").status_code == 200
        return len(captured)

    few = queries()
    days(30)
    for seconds in (70, 80, 90):
        waiting(seconds)
    assert queries() <= few <= 8


@pytest.fixture
def boss() -> Racer:
    return a_racer("boss", is_staff=True, is_superuser=True)


def test_admins_see_what_needs_a_hand_with_the_remedy(boss):
    now, today = timezone.now(), timezone.now().date()
    WorkerNode.objects.create(name="celery@gone", seen_at=now - timedelta(hours=1), queues=["celery"])
    season = {"starts_on": today - timedelta(days=300), "ends_on": today + timedelta(days=9)}
    create_season(slug="last", name="Last", continues=False, **season)
    StoredFile.objects.create(
        name="models/x.onnx", sha256="0" * 64, size=1, damage=Damage.MISSING, damaged_at=now, checked_at=now
    )
    program = make_program(by=boss, name="ci", purpose="Results", owner="boss", now=now)
    program.owner = None
    program.save()
    html = logged_in(boss).get("/needs/").content.decode()
    for words in ("celery@gone", "no heartbeat since", "last</strong>", "models/x.onnx", "program-ci"):
        assert words in html
    for area in ("workers", "seasons", "files", "programs"):
        assert f'id="area-{area}"' in html
    assert 'href="/guides/operators/#damaged-files"' in html


def test_a_season_that_continues_needs_no_hand(boss):
    today = timezone.now().date()
    create_season(slug="on", name="On", starts_on=today, ends_on=today + timedelta(days=9), continues=True)
    assert 'id="area-seasons"' not in logged_in(boss).get("/needs/").content.decode()


def test_others_do_not_see_what_needs_a_hand():
    assert logged_in(a_racer("bob")).get("/needs/").status_code == 403
    assert Client().get("/needs/").status_code == 302
