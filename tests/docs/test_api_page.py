"""docs/api.md describes the operations, codes and answers that there are."""

from __future__ import annotations

import json
import re

import pytest
from rest_framework import exceptions

import config.api.views  # noqa: F401  (its errors are codes, too)
from paddock.errors.reasons import REASONS
from paddock.rules.race import RULES, RaceRules
from tests.api.schema import SCHEMA

from .pages import RACERS, code_blocks, section, text

ROUTE = re.compile(r"`(GET|POST|PATCH|PUT|DELETE) (?:/api/v1)?(/[a-z_/{}]*)`")


@pytest.fixture(scope="module")
def routes() -> set[tuple[str, str]]:
    return {(method.upper(), path.removeprefix("/api/v1")) for path, item in SCHEMA["paths"].items() for method in item}


def test_every_operation_has_a_row(routes):
    rows = set(re.findall(r"^\| `([A-Z]+) (\S+)` \|", section(text("api.md"), "## Operations"), re.M))
    assert rows == routes


def test_every_named_operation_exists(routes):
    for page in ("api.md", "organisers.md", "operators.md", *RACERS, "webhooks.md"):
        assert set(ROUTE.findall(text(page))) <= routes, page


def api_codes() -> dict[str, int]:
    """Code and status of every failure that is not a reason."""

    def below(kind: type) -> list[type]:
        return [kind, *(each for child in kind.__subclasses__() for each in below(child))]

    return {kind.default_code: kind.status_code for kind in below(exceptions.APIException)}


def test_the_error_table_has_existing_codes_and_their_statuses():
    rows = re.findall(r"^\| ([\d, ]+) \| .+ \| (.+) \|$", section(text("api.md"), "## Errors"), re.M)
    assert len(rows) == 12
    known = api_codes()
    for statuses, codes in rows:
        allowed = {int(status) for status in statuses.split(", ")}
        for code in re.findall(r"`([a-z_]+)`", codes):
            if code == "fields":
                continue
            status = REASONS[code].status if code in REASONS else known[code]
            assert status in allowed, code


def test_every_code_of_the_api_is_in_the_table():
    table = section(text("api.md"), "## Errors")
    own = {code for code in api_codes() if code not in ("error", "parse_error")}
    missing = {code for code in own if f"`{code}`" not in table}
    assert not missing


def test_example_answers_have_the_fields_of_the_schema():
    shapes = {
        name: set(part["properties"]) for name, part in SCHEMA["components"]["schemas"].items() if "properties" in part
    }
    examples = [json.loads(block) for block in code_blocks(section(text("api.md"), "## Operations"), "json")]
    assert len(examples) >= 7
    for example in examples:
        # of the rules of a race an example shows some: the whole list is a page of its own
        assert set(example) in shapes.values() or set(example) | set(RULES) in shapes.values(), sorted(example)
    (evaluation,) = (example for example in examples if "queue" in example)
    assert set(evaluation["result"]) == shapes["Result"]
    assert set(evaluation["rules"]) <= set(RaceRules().to_dict())
    assert set(evaluation["result"]["laps"][0]) == shapes["Lap"]
    (board,) = (example for example in examples if "leader_ms" in example)
    assert set(board["results"][0]) == shapes["Row"]


def test_every_json_example_is_valid():
    for page in ("api.md", *RACERS, "webhooks.md"):
        for block in code_blocks(text(page), "json"):
            json.loads(block)
