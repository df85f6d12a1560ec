"""Requests made at random from the schema: nothing ends in a crash, and every answer is one that the schema names."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from functools import cache
from typing import Any

import pytest
from django.conf import settings as django_settings
from django.core.signals import request_finished, request_started
from django.db import close_old_connections, transaction
from django.utils import timezone
from hypothesis import HealthCheck, Phase, given, seed, settings
from knox.models import AuthToken
from rest_framework.throttling import ScopedRateThrottle

from accounts.models import Racer
from config.wsgi import application
from core import wakeup
from core.events import waking
from league.models import Notice, NoticeKind
from league.services import create_season, schedule_round
from league.services.webhooks import add_webhook, send_test
from races.models import Visibility
from races.services import accept_invitation
from races.services.timing import make_sensor
from tests.api.schema import SCHEMA
from tests.drawn_runs import a_drawing
from tests.evaluation.reports import a_report
from tests.factories import a_race, a_racer, drive, laps
from tests.kept import Kept
from tests.races.timing import a_physical_race, timed
from tests.training.jobs import a_trained_one
from training.vehicles import save_vehicle
from videos import drawing
from videos.services import ask_for_video, run_next_video

LABELS = [f"{method.upper()} {path}" for path, methods in SCHEMA["paths"].items() for method in methods]
# more of them, and others, by hand: PADDOCK_FUZZ_EXAMPLES=200 PADDOCK_FUZZ_SEED=1
EXAMPLES = int(os.environ.get("PADDOCK_FUZZ_EXAMPLES", "1"))
SEED = int(os.environ.get("PADDOCK_FUZZ_SEED", "0"))
pytestmark = pytest.mark.xdist_group(
    "fuzz"
)  # schemathesis takes long to load: in one process, and only when it is needed


@cache
def operations() -> dict[str, Any]:
    """Every operation of the schema, called within this process."""
    import schemathesis

    read = schemathesis.openapi.from_dict(SCHEMA)
    read.app = application
    return {operation.label: operation for operation in (found.ok() for found in read.get_all_operations())}


@cache
def checks() -> list:
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi import checks as of_schemas

    return [
        not_a_server_error,
        of_schemas.status_code_conformance,
        of_schemas.content_type_conformance,
        of_schemas.response_schema_conformance,
    ]


@pytest.fixture(autouse=True)
def one_connection():
    """What Django's own test client does: a request does not close the connection that holds the test's transaction."""
    signals = (request_started, request_finished)
    for signal in signals:
        signal.disconnect(close_old_connections)
    yield
    for signal in signals:
        signal.connect(close_old_connections)


@pytest.fixture(scope="session")
def kept_fuzzed(request, keep: Callable) -> Kept:
    return keep(request, make_fuzzed, fresh_s=20.0)  # as of the pages' world


@pytest.fixture
def fuzzed(kept_fuzzed: Kept, db: None, video_wakes, trainings_taken_on, monkeypatch) -> Fuzzed:
    rates = dict.fromkeys(("upload", "write", "timing"), "1000000/hour")
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", rates)
    return kept_fuzzed.copy()


@dataclass
class Fuzzed:
    """``known``: what addresses may name, so that requests also get past the first 404: all of it is Alice's.
    ``tokens``: the headers of everybody who may ask: a guest, a stranger, the owner of all that there is, an admin."""

    known: dict[str, str]
    tokens: dict[str, dict[str, str]]


def make_fuzzed() -> Fuzzed:
    """Without a broker, and with a video of a few bytes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wakeup, "publish", lambda name, **options: None)
        patch.setattr(waking, "wake", lambda name: None)
        patch.setattr(drawing, "write_video", a_drawing)
        patch.setattr(drawing, "poster", lambda scene: b"a still")
        patch.setattr(django_settings, "TRAINING", True)
        patch.setattr(django_settings, "TRAINING_PAUSED", False)
        alice = a_racer("alice")
        return Fuzzed(make_known(alice), make_tokens(alice))


def make_known(alice: Racer) -> dict[str, str]:
    now = timezone.now()
    race = a_race(now, slug="fuzzed", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=a_racer("guest"), now=now)
    season = create_season(slug="fuzzed", name="Fuzzed", starts_on=now.date(), ends_on=now.date() + timedelta(days=90))
    times = {"opens_at": now + timedelta(days=1), "closes_at": now + timedelta(days=9)}
    schedule_round(season=season, number=1, division="open", now=now, name="Month", track=race.track, **times)
    submission = drive(race, alice, laps(10_000, 10_000, 10_000), now)
    asked = ask_for_video(evaluation=submission.evaluation, by=alice, part="1", language="en", now=now)
    run_next_video(worker="w")
    notice = Notice.objects.create(racer=alice, kind=NoticeKind.OPENS, about="x", params={"race": "Fuzzed"}, at=now)
    real = a_physical_race(now, slug="real", organiser=alice)
    sensor = make_sensor(race=real, name="Gate", by=alice, now=now)[0]
    session = timed(real, alice, alice, now, 10_000)
    hook = add_webhook(owner=alice, url="https://example.org/hook")
    send_test(webhook=hook, now=now)
    return {
        "slug": "fuzzed",
        "tracks": "oval",
        "alias": "guest",
        "stage": "open-qualifier",
        "token": race.invitation,
        "evaluations": submission.evaluation.public_id,
        "models": submission.evaluation.model.public_id,
        "videos": asked.video.public_id,
        "reports": a_report(alice, now).public_id,
        "trainings": a_trained_one(alice, race.track, now).public_id,
        "vehicles": save_vehicle(owner=alice, name="Van", sensors=["STEREO_CAMERAS"]).public_id,
        "notices": notice.pk,
        "webhooks": hook.pk,
        "key": AuthToken.objects.create(user=alice)[0].token_key,
        "id": str(session.pk),
        "number": str(sensor.pk),
    }


def make_tokens(alice: Racer) -> dict[str, dict[str, str]]:
    """Nothing compressed: the library that checks the answers does not unpack them."""
    plain = {"Accept-Encoding": "identity"}

    def header(racer: Racer) -> dict[str, str]:
        return plain | {"Authorization": f"Token {AuthToken.objects.create(user=racer)[1]}"}

    sam = a_racer("sam", is_staff=True, is_superuser=True)
    return {"guest": plain, "stranger": header(a_racer("charlie")), "owner": header(alice), "staff": header(sam)}


@pytest.mark.slow
@pytest.mark.django_db
@pytest.mark.parametrize("examples", [EXAMPLES, pytest.param(20, marks=pytest.mark.soak)])
@pytest.mark.parametrize("label", LABELS)
def test_no_request_crashes_or_gets_an_undocumented_answer(label, examples, fuzzed):
    kind, known, tokens = label.split("/")[3], fuzzed.known, fuzzed.tokens

    def answers(case: Any, role: str) -> None:
        with transaction.atomic():  # whatever one of them does, the next one finds all of it there
            case.validate_response(case.call(headers=tokens[role]), checks=checks())
            transaction.set_rollback(True)

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=not SEED,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @seed(SEED)
    @given(case=operations()[label].as_strategy())
    def ask(case: Any) -> None:
        answers(case, "owner")
        for name in case.path_parameters or ():
            case.path_parameters[name] = known[kind] if kind in known else known.get(name)
        if kind == "races" and {"id", "number"} & set(case.path_parameters or ()):  # of the race of real cars
            case.path_parameters["slug"] = "real"
        for role in tokens:
            answers(case, role)

    ask()


def test_every_operation_of_the_schema_is_tested():
    assert set(LABELS) == set(operations())
