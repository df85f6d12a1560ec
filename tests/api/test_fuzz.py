"""Requests made at random from the schema: nothing ends in a crash, and every answer is one that the schema names."""

from __future__ import annotations

import os
from functools import cache
from typing import Any

import pytest
from django.core.signals import request_finished, request_started
from django.db import close_old_connections, transaction
from hypothesis import HealthCheck, Phase, given, seed, settings

from config.wsgi import application
from tests.api.schema import SCHEMA

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


@pytest.mark.slow
@pytest.mark.django_db
@pytest.mark.parametrize("examples", [EXAMPLES, pytest.param(20, marks=pytest.mark.soak)])
@pytest.mark.parametrize("label", LABELS)
def test_no_request_crashes_or_gets_an_undocumented_answer(label, examples, fuzzed):
    tokens, names = fuzzed.tokens, fuzzed.names(label.split()[1])
    others = [role for role in tokens if role != "owner"]
    # of one example, the owner and one other in turn: tests/access asks as everybody
    roles = list(tokens) if examples > 1 else ["owner", others[LABELS.index(label) % len(others)]]

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
            case.path_parameters[name] = names[name]
        for role in roles:
            answers(case, role)

    ask()


def test_every_operation_of_the_schema_is_tested():
    assert set(LABELS) == set(operations())
