"""Requests made at random from the schema: nothing ends in a crash, and every answer is one that the schema names."""

from __future__ import annotations

from datetime import timedelta
from functools import cache
from typing import Any

import pytest
from django.core.signals import request_finished, request_started
from django.db import close_old_connections
from django.utils import timezone
from drf_spectacular.generators import SchemaGenerator
from hypothesis import HealthCheck, Phase, given, settings
from knox.models import AuthToken
from rest_framework.throttling import ScopedRateThrottle

from league.services import create_season, schedule_round
from league.wsgi import application
from races.models import Visibility
from races.services import accept_invitation
from races.services.videos import ask_for_video, run_next_video
from tests.factories import a_race, a_racer, drive, laps

SCHEMA = SchemaGenerator().get_schema(request=None, public=True)
LABELS = [f"{method.upper()} {path}" for path, methods in SCHEMA["paths"].items() for method in methods]
EXAMPLES = 6
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


@pytest.fixture
def known(alice, films, monkeypatch) -> dict[str, str]:
    """What addresses may name, so that requests also get past the first 404; and a token that sees all of it."""
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", {"upload": "100000/hour", "write": "100000/hour"})
    now = timezone.now()
    race = a_race(now, slug="fuzzed", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=a_racer("guest"), now=now)
    season = create_season(slug="fuzzed", name="Fuzzed", starts_on=now.date(), ends_on=now.date() + timedelta(days=90))
    times = {"opens_at": now + timedelta(days=1), "closes_at": now + timedelta(days=9)}
    schedule_round(season=season, number=1, division="open", now=now, name="Month", track=race.track, **times)
    submission = drive(race, alice, laps(10_000, 10_000, 10_000), now)
    asked = ask_for_video(evaluation=submission.evaluation, by=alice, part="1", language="en", now=now)
    run_next_video(worker="w")
    return {
        "slug": "fuzzed",
        "alias": "guest",
        "stage": "open-qualifier",
        "token": race.invitation,
        "public_id": submission.evaluation.public_id,
        "model": submission.evaluation.model.public_id,
        "video": asked.video.public_id,
        "header": f"Token {AuthToken.objects.create(user=alice)[1]}",
    }


@pytest.mark.slow
@pytest.mark.django_db
@pytest.mark.parametrize("label", LABELS)
def test_no_request_crashes_or_is_answered_in_an_undescribed_way(label, known):
    headers = {"Authorization": known["header"]}

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operations()[label].as_strategy())
    def ask(case: Any) -> None:
        case.validate_response(case.call(headers=headers), checks=checks())
        if case.path_parameters:
            for name in case.path_parameters:
                kind = next((kind for kind in ("model", "video") if f"/{kind}s/{{" in label), name)
                case.path_parameters[name] = known[kind]
            if "/tracks/" in label:
                case.path_parameters["slug"] = "oval"
            case.validate_response(case.call(headers=headers), checks=checks())

    ask()


def test_every_operation_of_the_schema_is_tried():
    assert set(LABELS) == set(operations())
