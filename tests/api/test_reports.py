"""Reports on cars through the API."""

from __future__ import annotations

import pytest
from django.utils import timezone

from evaluation.garage.services import delete_model
from evaluation.models.reports import CarReport
from tests.evaluation.reports import a_report, drive, off_the_road
from tests.factories import a_model, a_racer, a_track
from tests.wakeups import heard

pytestmark = pytest.mark.django_db
AT = "/api/v1/reports/"


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture(autouse=True)
def _no_broker(monkeypatch):
    heard(monkeypatch, "evaluation.tasks.drive_reports")


def test_a_report_is_asked_for_and_read(alice, now, as_racer):
    said = {"model": a_model(alice).public_id, "track_set": "chosen", "tracks": [a_track().slug]}
    said |= {"variations_on": "oval", "direction": "cw", "seed": 5}
    made = as_racer(alice).post(AT, said, format="json")
    assert made.status_code == 201, made.data
    assert (made.data["state"], made.data["driven"], made.data["laps_in_all"]) == ("queued", 0, 102)
    assert made.data["robustness"] is None and made.data["laps"][0]["complete"] is None
    report = CarReport.objects.get()
    drive(report, now, off_the_road(39))
    told = as_racer(alice).get(f"{AT}{report.public_id}/").data
    assert (told["state"], told["grade"], told["driven"]) == ("finished", "A", 102)
    assert told["robustness"]["overall"]["completed"] == 99 and len(told["runs_sha256"]) == 64
    lap = next(lap for lap in told["laps"] if lap["variation"] == 39)
    assert (lap["kind"], lap["strength_percent"], lap["complete"], lap["percent"]) == ("light", 100, False, 31.5)
    assert told["laps"][0]["kind"] is None and lap["direction"] == "cw"


def test_a_model_alone_is_enough(alice, as_racer):
    a_track()
    answer = as_racer(alice).post(AT, {"model": a_model(alice).public_id, "variations_on": "oval"}, format="json")
    assert (answer.status_code, answer.data["track_set"], answer.data["seed"]) == (201, "league", 0)


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ({"model": "nobody"}, "report_model_gone"),
        ({"tracks": ["nowhere"]}, "report_track_gone"),
        ({"variations_on": "nowhere"}, "report_track_gone"),
        ({"track_set": "league", "tracks": ["oval"]}, "report_tracks"),
        ({"track_set": "none", "tracks": [], "variations_on": None}, "report_empty"),
        ({"direction": "up"}, "report_direction"),
        ({"seed": -1}, "invalid"),
        ({"track_set": "moon"}, "invalid"),
        ({"colour": "red"}, "invalid"),
    ],
)
def test_what_is_wrong_is_refused_with_its_code(alice, as_racer, said, code):
    usual = {"track_set": "chosen", "tracks": [a_track().slug], "variations_on": "oval"}
    answer = as_racer(alice).post(AT, {"model": a_model(alice).public_id} | usual | said, format="json")
    assert (answer.status_code, answer.data["code"]) == (404 if code.endswith("_gone") else 400, code), answer.data
    assert not CarReport.objects.exists()


def test_a_full_quota_is_told_before_and_refused(alice, now, as_racer, settings):
    settings.REPORTS_AT_ONCE = 1
    report = a_report(alice, now)
    usage = {one["name"]: one for one in as_racer(alice).get("/api/v1/me/usage/").data}
    assert (usage["reports_at_once"]["used"], usage["reports_at_once"]["limit"]) == (1, 1)
    answer = as_racer(alice).post(AT, {"model": report.model.public_id, "variations_on": "oval"}, format="json")
    assert (answer.status_code, answer.data["code"]) == (409, "reports_at_once")


def test_it_is_listed_filtered_stopped_repeated_and_deleted(alice, now, as_racer):
    client, report = as_racer(alice), a_report(alice, now)
    other = drive(a_report(alice, now), now)
    assert {one["public_id"] for one in client.get(AT).data["results"]} == {report.public_id, other.public_id}
    assert [one["public_id"] for one in client.get(AT, {"state": "finished"}).data["results"]] == [other.public_id]
    filtered = client.get(AT, {"model": report.model.public_id}).data["results"]
    assert [one["public_id"] for one in filtered] == [report.public_id]
    at = f"{AT}{report.public_id}/"
    under_way = client.delete(at)
    assert (under_way.status_code, under_way.data["code"]) == (409, "report_under_way")
    assert client.post(f"{at}stop/").data["state"] == "stopped"
    again = client.post(f"{at}again/")
    assert again.status_code == 201 and again.data["public_id"] != report.public_id
    assert client.delete(at).status_code == 204 and client.get(at).status_code == 404
    delete_model(model=other.model, now=now)
    assert client.post(f"{AT}{other.public_id}/again/").data["code"] == "report_model_gone"


def test_nobody_else_sees_it_but_admins_who_may_only_stop_it(alice, bob, now, as_racer, client):
    report = a_report(alice, now)
    at = f"{AT}{report.public_id}/"
    for way in ("", "stop/", "again/"):
        answer = getattr(as_racer(bob), "post" if way else "get")(f"{at}{way}")
        assert answer.status_code == 404
    assert as_racer(bob).delete(at).status_code == 404 and as_racer(bob).get(AT).data["results"] == []
    assert client.get(at).status_code == 401
    staff = as_racer(a_racer("steward", is_staff=True))
    assert staff.get(at).status_code == 200 and staff.get(AT).data["results"] == []
    assert staff.delete(at).status_code == staff.post(f"{at}again/").status_code == 403
    assert staff.post(f"{at}stop/").data["state"] == "stopped"
