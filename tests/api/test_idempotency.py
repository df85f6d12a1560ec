"""Writes with an Idempotency-Key: sent again, they act once and get the first answer."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from django.apps import apps
from django.core.files.uploadedfile import SimpleUploadedFile
from django.http import HttpRequest, QueryDict
from django.utils import timezone
from rest_framework.test import APIClient

from accounts.models import GroupMember, Racer
from core.api import idempotency
from core.api.models import StoredAnswer
from evaluation.garage import services as garage
from evaluation.models import TrainedModel
from tests.api.fuzzed import Fuzzed
from tests.api.schema import SCHEMA
from tests.courses.assignments import a_group, an_assignment
from tests.factories import a_model, a_race, a_racer
from tests.live_shows import an_ended_show
from tests.soak import some
from training.models import Vehicle

pytestmark = pytest.mark.django_db
VEHICLES = "/api/v1/vehicles/"
KEY = {"Idempotency-Key": "8e03978e-40d5-43dd-bc93-6894a57f9324"}
VAN = {"name": "Evo", "sensors": ["STEREO_CAMERAS"]}


@pytest.fixture
def owner(alice, cast) -> APIClient:
    return cast["owner"]


class TestKey:
    def test_the_same_request_gets_the_first_answer_again(self, owner):
        first, again = owner.post(VEHICLES, VAN, headers=KEY), owner.post(VEHICLES, VAN, headers=KEY)
        assert (first.status_code, again.status_code) == (201, 201) and first.content == again.content
        assert again["Idempotent-Replayed"] == "true" and not first.has_header("Idempotent-Replayed")
        assert Vehicle.objects.count() == 1

    def test_order_and_spacing_of_the_body_do_not_matter(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        text = json.dumps(dict(reversed(VAN.items())), indent=4)
        again = owner.post(VEHICLES, text, content_type="application/json", headers=KEY)
        assert again.status_code == 201 and again["Idempotent-Replayed"] == "true"

    def test_another_body_with_the_same_key_is_refused(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        refused = owner.post(VEHICLES, VAN | {"name": "Other"}, headers=KEY)
        assert (refused.status_code, refused.json()["code"]) == (422, "idempotency_key_reused")
        assert Vehicle.objects.count() == 1

    def test_another_query_with_the_same_key_is_refused(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        assert owner.post(f"{VEHICLES}?lang=ko", VAN, headers=KEY).status_code == 422

    def test_a_key_belongs_to_one_racer_and_one_address(self, owner, cast):
        owner.post(VEHICLES, VAN, headers=KEY)
        assert not cast["member"].post(VEHICLES, VAN, headers=KEY).has_header("Idempotent-Replayed")
        assert owner.post("/api/v1/notices/read/", headers=KEY).status_code == 200
        assert Vehicle.objects.count() == 2

    def test_a_quoted_key_is_the_same_key(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        quoted = {"Idempotency-Key": f'"{KEY["Idempotency-Key"]}"'}
        assert owner.post(VEHICLES, VAN, headers=quoted)["Idempotent-Replayed"] == "true"

    @pytest.mark.parametrize("key", ["", " ", "a b", "ü", "x" * 256, "a\tb", "\x7f"])
    def test_an_invalid_key_is_refused(self, owner, key):
        refused = owner.post(VEHICLES, VAN, headers={"Idempotency-Key": key})
        assert (refused.status_code, refused.json()["code"]) == (400, "idempotency_key_invalid")
        assert not Vehicle.objects.exists()

    @pytest.mark.parametrize("key", ["x", "x" * 255, "~!#"])
    def test_a_key_within_the_bounds_is_taken(self, owner, key):
        assert owner.post(VEHICLES, VAN, headers={"Idempotency-Key": key}).status_code == 201

    @pytest.mark.parametrize("key", ["a-key", "not a key"])
    def test_a_stranger_learns_nothing_of_body_and_key(self, owner, cast, key):
        slug = owner.post("/api/v1/classes/", {"name": "Mine"}).json()["slug"]
        options: dict[str, Any] = {"content_type": "application/json", "headers": {"Idempotency-Key": key}}
        refused = cast["stranger"].post(f"/api/v1/classes/{slug}/learners/", "{", **options)
        assert (refused.status_code, refused.json()["code"]) == (404, "not_found")

    def test_fields_of_a_form_are_told_from_further_values(self, owner):
        said = [QueryDict("name=a&name=sensors&name=b"), QueryDict("name=a&sensors=b")]
        digests = {idempotency._digest_of(SimpleNamespace(_request=HttpRequest(), data=each)) for each in said}
        assert len(digests) == 2

    def test_no_cache_keeps_an_answer_with_a_secret(self, owner):
        said = {"url": "https://8.8.8.8/hook"}
        for _ in range(2):
            answer = owner.post("/api/v1/webhooks/", said, headers=KEY)
            assert answer.json()["secret"] and answer["Cache-Control"] == "no-store"

    def test_a_refusal_is_not_stored(self, owner):
        assert owner.post(VEHICLES, {"name": ""}, headers=KEY).status_code == 400
        assert owner.post(VEHICLES, VAN, headers=KEY).status_code == 201

    def test_an_answer_is_kept_for_a_day(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        now = StoredAnswer.objects.get().made_at
        assert idempotency.forget_answers(now=now + timedelta(hours=24)) == 0
        assert idempotency.forget_answers(now=now + timedelta(hours=24, seconds=1)) == 1
        assert owner.post(VEHICLES, VAN, headers=KEY).json()["code"] == "vehicle_name_taken"

    def test_the_database_holds_neither_key_nor_answer_in_the_clear(self, owner):
        owner.post(VEHICLES, VAN, headers=KEY)
        row = StoredAnswer.objects.get()
        assert KEY["Idempotency-Key"] not in f"{row.digest} {row.request} {row.body}" and "Evo" not in row.body

    def test_a_failure_before_the_answer_is_stored_creates_nothing(self, owner, monkeypatch):
        """As a process does that is killed in this moment."""
        with monkeypatch.context() as patch:
            patch.setattr(idempotency.Repeat, "keep", lambda *args, **options: 1 / 0)
            owner.raise_request_exception = False
            assert owner.post(VEHICLES, VAN, headers=KEY).status_code == 500
        assert not Vehicle.objects.exists()
        assert owner.post(VEHICLES, VAN, headers=KEY).status_code == 201

    def test_a_replay_comes_before_the_condition(self, owner):
        headers = KEY | {"If-Match": owner.get(VEHICLES)["ETag"]}
        first, again = owner.post(VEHICLES, VAN, headers=headers), owner.post(VEHICLES, VAN, headers=headers)
        assert (first.status_code, again.status_code) == (201, 201)

    def test_a_token_is_given_again_for_the_right_password_only(self, alice, client):
        alice.set_password("correct horse battery")
        alice.save()
        said = {"login": "alice", "password": "correct horse battery"}
        options: dict[str, Any] = {"content_type": "application/json", "headers": KEY}
        first = client.post("/api/v1/auth/token/", said, **options)
        again = client.post("/api/v1/auth/token/", said, **options)
        assert (first.status_code, first.json()) == (again.status_code, again.json())
        assert first.json()["token"] not in StoredAnswer.objects.get().body
        wrong = client.post("/api/v1/auth/token/", said | {"password": "wrong"}, **options)
        assert wrong.json()["code"] == "wrong_credentials"


# --- every creating operation of the schema ---------------------------------------------------------------------------
CREATING = sorted(
    (operation["operationId"], path)
    for path, methods in SCHEMA["paths"].items()
    for method, operation in methods.items()
    if method == "post" and {"201", "202"} & set(operation["responses"])
)
SOON = (timezone.now() + timedelta(days=20)).isoformat()
LATER = (timezone.now() + timedelta(days=25)).isoformat()


def a_centre_line() -> bytes:
    from math import cos, pi, sin

    rows = (f"{6 * cos(2 * pi * i / 90):.4f},{4 * sin(2 * pi * i / 90):.4f},0.5,0.5" for i in range(90))
    return "\n".join(["x_m,y_m,w_tr_right_m,w_tr_left_m", *rows]).encode()


# what each is sent, with the ids of the world
SENT: dict[str, Callable[[dict[str, str]], dict[str, Any]]] = {
    "add_learners": lambda known: {"names": ["Mia"]},
    "add_reference": lambda known: {"name": "House car", "model": known["models"]},
    "add_teacher": lambda known: {"alias": "sam"},
    "add_vehicle": lambda known: VAN,
    "add_webhook": lambda known: {"url": "https://8.8.8.8/hook"},
    "ask_for_live_highlights": lambda known: {},
    "ask_for_video": lambda known: {"part": "2"},
    "copy_season": lambda known: {},
    "create_assignment": lambda known: {
        **{"group": "assigned", "title": "Second", "opens_at": SOON, "due_at": LATER},
        "parts": [
            {"title": "Laps", "points": 100, "pass_rule": "laps_in_row", "rules": {"laps": 5}}
            | {"tracks": [{"track": "oval"}]}
        ],
    },
    "create_class": lambda known: {"name": "Another class"},
    "create_group": lambda known: {"name": "Another group"},
    "create_evaluation": lambda known: {"model": known["models"], "track": "oval"},
    "create_program": lambda known: {"name": "another", "purpose": "Results", "owner": "alice"},
    "create_program_token": lambda known: {"scopes": ["read"], "days": 1},
    "replace_program_token": lambda known: {"days": 1},
    "create_race": lambda known: {"name": "New", "track": "oval", "opens_at": SOON, "closes_at": LATER},
    "create_report": lambda known: {"model": known["models"], "track_set": "none", "variations_on": "oval"},
    "create_round": lambda known: (
        {"number": 2, "stage": "open-qualifier", "month": "Next", "name": "Next", "slug": "next-round"}
        | {"track": "oval", "opens_at": SOON, "closes_at": LATER}
    ),
    "create_season": lambda known: (
        {"slug": "2099", "name": "2099", "starts_on": "2099-01-01", "ends_on": "2099-12-01"}
    ),
    "create_sweep": lambda known: (
        {"name": "tune-2", "track": "oval", "reward_code": "def reward_function(params):\n    return 1.0\n"}
        | {"settings": 3, "budget_s": 60, "search": {"hyperparameters": {"lr": {"low": 0.0001, "high": 0.001}}}}
    ),
    "create_submission_group": lambda known: {"name": "Blue", "racers": [known["assigned"]["all"]["alias"]]},
    "create_token": lambda known: {"login": "alice", "password": "correct horse battery"},
    "create_training": lambda known: (
        {"name": "new", "track": "oval", "reward_code": "def reward_function(params):\n    return 1.0\n"}
    ),
    "evaluate_training": lambda known: {"model": "best"},
    "found_team": lambda known: {"name": "Another team"},
    "invite_to_team": lambda known: {"racer": "guest"},
    "give_extension": lambda known: {"racer": known["assigned"]["all"]["alias"], "due_at": SOON},
    "hand_in": lambda known: {"model": known["models"]},
    "import_track": lambda known: ({"name": "Oval of mine", "file": SimpleUploadedFile("line.csv", a_centre_line())}),
    "make_sensor": lambda known: {"name": "Second gate"},
    "plan_live": lambda known: {"starts_at": SOON},
    "propose_regrade": lambda known: {"reason": "Too many points for laps"},
    "repeat_evaluation": lambda known: {},
    "repeat_report": lambda known: {},
    "submit_model": lambda known: {"model": known["spare"]},
    "test_webhook": lambda known: {},
    "upload_model": lambda known: {"package": SimpleUploadedFile("Bolt.tar.gz", b"a car")},
}
STAFF = (
    *("create_season", "create_round", "copy_season"),
    *("create_program", "create_program_token", "replace_program_token"),
)


def test_every_creating_operation_is_tried_and_documents_the_key():
    assert {name for name, _ in CREATING} == set(SENT)
    for path, methods in SCHEMA["paths"].items():
        for method, operation in methods.items():
            takes = any(each["name"] == "Idempotency-Key" for each in operation.get("parameters", ()))
            assert takes == (method == "post" and operation["operationId"] != "tell_crossing"), path


@pytest.mark.parametrize(("name", "path"), some(CREATING, 3))
def test_every_creating_operation_of_the_schema_acts_once(name, path, fuzzed, monkeypatch):
    alice = Racer.objects.get(alias="alice")
    path, sent = prepared(name, path, fuzzed, alice, monkeypatch), SENT[name]
    role = {"found_team": "stranger"}.get(name, "staff" if name in STAFF else "owner")
    client = APIClient(headers=fuzzed.tokens[role])
    form = "multipart" if name in ("upload_model", "import_track") else "json"
    first = client.post(path, sent(fuzzed.known), format=form, headers=KEY)
    assert first.status_code in (201, 202), first.content
    rows = counted()
    again = client.post(path, sent(fuzzed.known), format=form, headers=KEY)
    assert (again.status_code, again.content) == (first.status_code, first.content)
    assert again["Idempotent-Replayed"] == "true" and counted() == rows
    if name == "create_token":  # the password comes first
        return
    other = {"name": "another"} if form == "multipart" else {"another": 1}
    if name == "import_track":
        other["file"] = SimpleUploadedFile("line.csv", b"0,0")
    if name == "upload_model":
        other["package"] = SimpleUploadedFile("Bolt.tar.gz", b"another car")
    refused = client.post(path, other, format=form, headers=KEY)
    assert (refused.status_code, refused.json()["code"]) == (422, "idempotency_key_reused")
    assert counted() == rows


def counted() -> dict[str, int]:
    """Rows of every table that an operation may add to; a read of tokens writes down when they were used."""
    return {model.__name__: model._base_manager.count() for model in apps.get_models() if model._meta.managed}


def prepared(name: str, path: str, world: Fuzzed, alice: Racer, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address, with what this operation needs beside the kept world."""
    now = timezone.now()
    if name == "create_token":
        alice.set_password("correct horse battery")
        alice.save()
    elif name == "upload_model":
        model = TrainedModel.objects.get(public_id=world.known["models"])
        monkeypatch.setattr(garage, "admit", lambda files, *rest, **options: an_admitted(files, model))
    elif name == "submit_model":
        world.known["spare"] = a_model(alice).public_id
        return f"/api/v1/races/{a_race(now, slug='open-now').slug}/submissions/"
    elif name == "hand_in":  # in a class of which Alice is a student
        group, _students = a_group(a_racer("teacher"), 0, now)
        GroupMember.objects.create(group=group, racer=alice, asked_at=now, confirmed_at=now, confirmed_by=group.leader)
        return f"/api/v1/assignments/{an_assignment(group, now).public_id}/attempts/"
    elif name == "make_sensor":
        return "/api/v1/races/real/sensors/"
    elif name == "plan_live":
        a_race(now, slug="ahead", organiser=alice, closes_at=now + timedelta(days=9))
        return "/api/v1/races/ahead/live/"
    elif name == "ask_for_live_highlights":
        return f"/api/v1/races/{an_ended_show(now, alice).race.slug}/live/highlights/"
    elif name == "repeat_evaluation":
        client = APIClient(headers=world.tokens["owner"])
        made = client.post("/api/v1/evaluations/", SENT["create_evaluation"](world.known), format="json").json()
        return f"/api/v1/evaluations/{made['public_id']}/again/"
    return world.fill(path)


def an_admitted(files: Any, model: TrainedModel) -> Any:
    from evaluation.garage.admission import AdmittedPackage
    from paddock.network.bound import NetworkFacts
    from paddock.packages.metadata import parse_metadata

    onnx = b"onnx of " + files[0].stream.read()
    return AdmittedPackage(
        onnx=onnx,
        sha256=hashlib.sha256(onnx).hexdigest(),
        metadata=parse_metadata(json.dumps(model.metadata).encode()),
        source_kind="tensorflow",
        source_sha256=hashlib.sha256(b"source").hexdigest(),
        parameters=7,
        macs=9,
        facts=NetworkFacts(bound=1e-6),
    )
