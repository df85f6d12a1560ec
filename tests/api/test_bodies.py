"""A field that an operation does not know is refused, by every operation that writes, and nothing is changed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import pytest
from django.conf import settings as django_settings
from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.utils import timezone
from knox.models import AuthToken
from rest_framework.test import APIClient

from accounts.class_accounts.services import add_learners, add_teacher, make_class
from accounts.groups.services import ask_to_join, confirm_member, make_group
from accounts.models import Racer
from accounts.programs.services import make_program, make_program_token
from accounts.teams.services import found_team, invite_to_team, join_by_link
from core.api.bodies import MAX_NAME, MAX_NAMED
from core.events import waking
from core.wakeups import workers as wakeup
from league.models import Notice, Round, Stage
from league.notices import kinds as notice_kinds
from league.seasons.services.seasons import create_season
from league.webhooks.services import add_webhook
from races.entries.services.entries import accept_invitation
from races.models import MeasuredLap, Race, RaceState, TimingSensor, Visibility
from races.test_runs.services import drive_own
from races.timing.services import make_sensor
from tests.api.schema import SCHEMA
from tests.courses.assignments import assigned_to_students
from tests.evaluation.reports import a_report
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.kept import Kept
from tests.live_shows import an_ended_show
from tests.races.timing import a_timed_race
from tests.training.jobs import a_sweep_row, a_training
from training.vehicles.services import save_vehicle
from videos.models import Video

WRITES = sorted(
    (method, path)
    for path, operations in SCHEMA["paths"].items()
    for method in operations
    if method in ("post", "put", "patch", "delete")
)
NAMES = [f"{method} {path}" for method, path in WRITES]


def body_of(method: str, path: str) -> tuple[str, dict] | None:
    """Content type and schema of what the operation takes; None where it takes nothing."""
    content = SCHEMA["paths"][path][method].get("requestBody", {}).get("content", {})
    assert len(content) <= 1, f"{method} {path} takes several forms: send each of them here"
    for kind, described in content.items():
        name = described["schema"]["$ref"].rsplit("/", 1)[1]
        return kind, SCHEMA["components"]["schemas"][name]
    return None


@dataclass
class Owned:
    """What addresses may name, all of it Alice's own. ``of``: the ids of what a room's addresses name."""

    alice: Racer
    names: dict[str, str]
    of: dict[str, str]
    numbers: dict[str, int]
    real: dict[str, Any]
    guest: int
    shown: str
    learner: str
    assigned: dict[str, dict[str, Any]]

    def fill(self, path: str) -> str:
        """An address with what it names filled in."""
        if "/live/" in path:
            return path.format(slug=self.shown)
        if "/assignments/" in path:
            room = path.removeprefix("/api/v1/assignments/{public_id}/").split("/")[0]
            return path.format(**self.assigned["all"] | self.assigned.get(room, {}))
        if "/classes/" in path:
            return path.format(slug="tried-class", alias=self.learner if "/learners/" in path else "guest")
        if "/teams/" in path and "/invitations/" in path:
            return path.format(slug="tried", alias="fast")
        if "/programs/" in path:
            return path.format(alias="program-tried", key=self.names["program_key"])
        if "/guests/" in path:
            return path.format(slug=self.real["slug"], id=self.guest)
        if re.search("/(timing|sessions|laps|sensors|timekeepers)/", path):
            return path.format(**self.names | self.real)
        room = path.removeprefix("/api/v1/").split("/")[0]
        return path.format(**self.names, public_id=self.of.get(room), number=self.numbers.get(room))


def make_owned() -> Owned:
    """Without a broker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wakeup, "publish", lambda name, **options: None)
        patch.setattr(waking, "wake", lambda name: None)
        patch.setattr(django_settings, "TRAINING", True)
        patch.setattr(django_settings, "TRAINING_PAUSED", False)
        return _made_owned(a_racer("alice"), timezone.now())


def _made_owned(alice: Racer, now: datetime) -> Owned:
    race = a_race(now, slug="tried", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=a_racer("guest"), now=now)
    evaluation = drive(race, alice, laps(10_000, 10_000, 10_000), now).evaluation
    video = Video.objects.create(evaluation=evaluation, asked_by=alice, language="en")
    season = create_season(slug="tried", name="Tried", starts_on=now.date(), ends_on=now.date() + timedelta(days=9))
    ahead = a_race(now, kind="league", division="open", opens_at=now + timedelta(days=1))
    Round.objects.create(season=season, number=1, stage=Stage.OPEN, race=ahead)
    names = {"slug": "tried", "race": ahead.slug, "alias": "guest", "token": race.invitation, "stage": "open-qualifier"}
    names["key"] = AuthToken.objects.create(user=alice)[0].token_key
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    program = make_program(by=boss, name="tried", purpose="Results", owner="alice", now=now)
    made, _text = make_program_token(program=program, by=boss, scopes=["read"], days=7, now=now)
    names["program_key"] = made.token_key
    notice = Notice.objects.create(racer=alice, kind=notice_kinds.OPENS, about="x", params={"race": "Tried"}, at=now)
    real, mia = a_timed_race(now, alice, a_racer("fast"))
    of = {
        "models": evaluation.model,
        "evaluations": drive_own(owner=alice, model=evaluation.model, track=race.track, now=now).evaluation,
        "trainings": a_training(alice, a_track(), now),
        "sweeps": a_sweep_row(alice, race.track, now),
        "videos": video,
        "vehicles": save_vehicle(owner=alice, name="Van", sensors=["STEREO_CAMERAS"]),
        "reports": a_report(alice, now),
    }
    assigned, attempt = assigned_to_students(alice, now)
    of["attempts"] = attempt
    return Owned(
        alice,
        names,
        {room: one.public_id for room, one in of.items()},
        {"notices": notice.pk, "webhooks": add_webhook(owner=alice, url="https://example.org/hook").pk},
        {
            "slug": real.slug,
            "alias": "fast",
            "id": MeasuredLap.objects.filter(session__race=real).first().pk,
            "number": TimingSensor.objects.get(race=real).pk,
        },
        mia.pk,
        an_ended_show(now, alice, laps={"alice": (8_000,), "bob": (8_500,)}).race.slug,
        _belonging(alice, Racer.objects.get(alias="guest"), now),
        assigned,
    )


def _belonging(alice: Racer, guest: Racer, now: datetime) -> str:
    """A group, a team and a class of Alice's, with the guest in each. The alias of a learner."""
    group = make_group(by=alice, name="Tried", now=now)
    for racer in (alice, guest):
        confirm_member(member=ask_to_join(code=group.code, racer=racer, now=now), by=alice, now=now)
    team = found_team(by=alice, name="Tried", now=now)
    join_by_link(code=team.code, racer=guest, now=now)
    invite_to_team(team=team, alias="fast", by=alice, now=now)
    classroom = make_class(teacher=alice, name="Tried class", plan=[], now=now)
    add_teacher(classroom=classroom, by=alice, alias="guest", now=now)
    return add_learners(classroom=classroom, by=alice, names=["Kim Minji"], now=now)[0].learner.racer.alias


@pytest.fixture(scope="session")
def kept_owned(request, keep: Callable) -> Kept:
    return keep(request, make_owned, fresh_s=60.0)


@pytest.fixture
def owned(kept_owned: Kept, db: None, trainings_taken_on, wakes) -> Owned:
    return kept_owned.copy()


def written(queries: CaptureQueriesContext) -> list[str]:
    """What was changed, but for the note that a token was used."""
    return [
        query["sql"]
        for query in queries
        if query["sql"].split(maxsplit=1)[0].upper() in ("INSERT", "UPDATE", "DELETE", "REPLACE")
        and "accounts_tokengrant" not in query["sql"]
    ]


@pytest.mark.parametrize(("method", "path"), WRITES, ids=NAMES)
def test_every_write_refuses_an_unknown_field(method, path, owned, as_racer):
    alice = owned.alice
    taken = body_of(method, path)
    kind = "multipart" if taken and taken[0] == "multipart/form-data" else "json"
    client, address = as_racer(alice), owned.fill(path)
    if path == "/api/v1/timing/crossings/":  # a sensor's own token
        _, token = make_sensor(race=Race.objects.get(slug="real-race"), name="Line", by=alice, now=timezone.now())
        client.credentials(HTTP_AUTHORIZATION=f"Bearer {token}")
    if path.startswith(("/api/v1/seasons/", "/api/v1/programs/")):  # admins alone write these
        Racer.objects.filter(pk=alice.pk).update(is_staff=True, is_superuser=True)
    with CaptureQueriesContext(connection) as queries:
        answer = getattr(client, method)(address, {"lapz": 5}, format=kind)
    assert (answer.status_code, answer.data["code"]) == (400, "invalid"), answer.data
    (problem,) = answer.data["fields"]["lapz"]
    assert problem["code"] == ("unknown_field" if taken else "no_fields")
    if taken:
        assert "lapz" in problem["message"]
        for name in taken[1]["properties"]:
            assert name in problem["message"]
    assert written(queries) == []


def test_the_schema_forbids_additional_fields_in_a_body():
    taken = {(method, path): body_of(method, path) for method, path in WRITES}
    assert sum(map(bool, taken.values())) > 50
    assert [each for each, body in taken.items() if body and body[1]["additionalProperties"] is not False] == []


def test_response_schemas_allow_new_fields():
    closed = {name for name, each in SCHEMA["components"]["schemas"].items() if "additionalProperties" in each}
    sent = {name for name in closed if name.endswith("Request")}
    assert closed == sent


@pytest.mark.django_db
def test_a_misspelt_rule_is_refused_with_all_other_problems(alice, as_racer):
    now = timezone.now()
    sent = {"name": "Slalom", "track": a_track().slug, "lapz": 5, "opens_at": "soon"}
    answer = as_racer(alice).post("/api/v1/races/", sent | {"closes_at": now + timedelta(days=1)})
    assert answer.status_code == 400
    assert set(answer.data["fields"]) == {"lapz", "opens_at"}
    assert not Race.objects.exists()


@pytest.mark.django_db
def test_an_unknown_field_within_a_box_is_refused(alice, as_racer):
    race = a_race(timezone.now(), organiser=alice)
    place = {"fraction": 0.25, "lane": "inner", "lain": "outer"}
    answer = as_racer(alice).patch(f"/api/v1/races/{race.slug}/", {"race_type": "object_avoidance", "boxes": [place]})
    assert answer.data["fields"]["boxes.0.lain"][0]["code"] == "unknown_field"
    race.refresh_from_db()
    assert race.boxes == []


@pytest.mark.django_db
def test_an_unknown_field_within_a_box_of_a_training_is_refused(alice, as_racer, trainings_taken_on):
    place = {"fraction": 0.25, "lane": "inner", "lain": "outer"}
    sent = {"name": "first-car", "track": a_track().slug, "reward_code": "x", "race_type": "object_avoidance"}
    answer = as_racer(alice).post("/api/v1/trainings/", sent | {"boxes": [place, {"fraction": 0.5}]})
    problems = {name: errors[0]["code"] for name, errors in answer.data["fields"].items()}
    assert problems == {"boxes.0.lain": "unknown_field", "boxes.1.lane": "required"}
    answer = as_racer(alice).post("/api/v1/trainings/", sent | {"boxes": [{"fraction": 0.5, "lane": "inner"}] * 11})
    assert set(answer.data["fields"]) == {"boxes"}


@pytest.mark.django_db
def test_a_race_cannot_be_sent_back_as_it_was_read(alice, as_racer):
    """What cannot be changed would be left as it was without a word."""
    race = a_race(timezone.now(), organiser=alice)
    answer = as_racer(alice).patch(f"/api/v1/races/{race.slug}/", {"laps": 4, "slug": "another"})
    assert set(answer.data["fields"]) == {"slug"}
    race.refresh_from_db()
    assert race.laps == 3


@pytest.mark.django_db
def test_an_unexpected_file_in_an_upload_is_refused(alice, as_racer):
    extra = SimpleUploadedFile("notes.txt", b"hello")
    answer = as_racer(alice).post("/api/v1/models/", {"notes": extra, "name": "Bolt"}, format="multipart")
    assert answer.data["fields"]["notes"][0]["code"] == "unknown_field"


@pytest.mark.django_db
def test_a_form_may_carry_a_csrf_token(alice):
    client = APIClient(enforce_csrf_checks=True)
    client.force_login(alice)
    client.cookies["csrftoken"] = token = "a" * 32
    sent = {"csrfmiddlewaretoken": token, "model": SimpleUploadedFile("car.onnx", b"")}
    answer = client.post("/api/v1/models/", sent, format="multipart")
    assert answer.status_code == 400
    assert "fields" not in answer.data, answer.data  # it is the file that is refused


@pytest.mark.django_db
@pytest.mark.parametrize("body", ["", "{}", "null", "[]"])
def test_an_operation_without_fields_accepts_an_empty_body(alice, as_racer, body):
    race = a_race(timezone.now())
    answer = as_racer(alice).generic("POST", f"/api/v1/races/{race.slug}/entry/", body, "application/json")
    assert answer.status_code == 200


@pytest.mark.django_db
@pytest.mark.parametrize("body", ['["x"]', '"x"', "5"])
def test_an_operation_without_fields_refuses_any_other_body(alice, as_racer, body):
    race = a_race(timezone.now(), organiser=alice)
    answer = as_racer(alice).generic("POST", f"/api/v1/races/{race.slug}/invitation/", body, "application/json")
    assert answer.data["fields"][""][0]["code"] == "no_fields"
    invitation = race.invitation
    race.refresh_from_db()
    assert race.invitation == invitation


@pytest.mark.django_db
@pytest.mark.parametrize("body", ['["x"]', '"x"', "5"])
def test_a_body_that_is_no_object_closes_no_race(alice, as_racer, body):
    race = a_race(timezone.now(), organiser=alice)
    answer = as_racer(alice).generic("POST", f"/api/v1/races/{race.slug}/close/", body, "application/json")
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    race.refresh_from_db()
    assert race.state_at(timezone.now()) == RaceState.OPEN


@pytest.mark.django_db
@pytest.mark.parametrize("body", ['["x"]', '"x"', "5"])
def test_an_operation_whose_fields_may_be_left_out_refuses_what_are_none(alice, as_racer, body):
    race = a_race(timezone.now())
    answer = as_racer(alice).generic("POST", f"/api/v1/races/{race.slug}/entry/", body, "application/json")
    assert answer.status_code == 400 and not race.entries.exists()


@pytest.mark.django_db
def test_unknown_field_names_are_reported_up_to_a_limit(alice, as_racer):
    model = a_model(alice)
    names = ["\ud800", "", "message", "code", "x" * 5000, *(f"f{number}" for number in range(5000))]
    body = json.dumps(dict.fromkeys(names, 1))
    answer = as_racer(alice).generic("PATCH", f"/api/v1/models/{model.public_id}/", body, "application/json")
    assert answer.status_code == 400
    told = json.loads(answer.content)["fields"]
    assert len(told) == MAX_NAMED
    assert max(map(len, told)) == MAX_NAME
    assert {"message", "code", ""} <= set(told)


@pytest.mark.django_db
def test_unknown_fields_named_like_error_keys_are_reported(alice, as_racer):
    answer = as_racer(alice).patch(f"/api/v1/models/{a_model(alice).public_id}/", {"message": 1, "code": 2})
    assert {name: [each["code"] for each in problems] for name, problems in answer.data["fields"].items()} == {
        "message": ["unknown_field"],
        "code": ["unknown_field"],
    }


@pytest.mark.django_db
def test_the_message_is_in_the_language_of_the_request(alice, as_racer):
    address = f"/api/v1/models/{a_model(alice).public_id}/"
    english, korean = (
        as_racer(alice).patch(address, {"nam": "x"}, headers={"accept-language": language}).data["message"]
        for language in ("en", "ko")
    )
    assert english != korean
    assert "name" in korean


@pytest.mark.django_db
@pytest.mark.parametrize(
    "address",
    [
        "/api/v1/races/?state=opne",
        "/api/v1/races/?kind=x",
        "/api/v1/races/?race_type=x",
        "/api/v1/races/?mine=perhaps",
        "/api/v1/models/?shared=perhaps",
        "/api/v1/races/?page_size=ten",
        "/api/v1/tracks/?page_size=0",
        "/api/v1/tracks/?page_size=-1",
        "/api/v1/races/?page_size=101",
        "/api/v1/races/tried/board/?page=x",
        "/api/v1/races/tried/board/?page_size=101",
    ],
)
def test_an_invalid_query_parameter_is_refused(address, alice, as_racer):
    a_race(timezone.now(), slug="tried")
    answer = as_racer(alice).get(address)
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    assert answer.data["fields"]


@pytest.mark.django_db
def test_an_unknown_query_parameter_is_ignored(alice, as_racer):
    assert as_racer(alice).get("/api/v1/races/?utm_source=x&page_size=100").status_code == 200


@pytest.mark.django_db
@pytest.mark.parametrize("field", ["opens_at", "closes_at"])
def test_a_time_without_an_offset_is_refused(field, alice, as_racer):
    opens, closes = (timezone.now() + timedelta(days=days) for days in (1, 2))
    sent = {"name": "Night race", "track": a_track().slug}
    sent |= {"opens_at": f"{opens:%Y-%m-%dT%H:%M:%SZ}", "closes_at": f"{closes:%Y-%m-%dT%H:%M:%S}+09:00"}
    answer = as_racer(alice).post("/api/v1/races/", sent | {field: sent[field][:19]})
    assert (answer.status_code, answer.data["fields"][field][0]["code"]) == (400, "no_offset")
    assert as_racer(alice).post("/api/v1/races/", sent).status_code == 201
