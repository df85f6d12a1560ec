"""A valid body for every write: from the schema for an operation, from the form as a browser shows it for a page."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import timedelta
from typing import Any
from uuid import UUID

from django.core.files import File
from django.core.files.uploadedfile import SimpleUploadedFile
from django.utils import timezone

from tests.access.cast import Cast
from tests.access.routes import Row
from tests.api.schema import SCHEMA
from tests.api.test_bodies import body_of
from tests.pages.form_cases import A_CAR, A_TRACK, CASES
from tests.pages.forms import filled_form

# by the name of a field of an operation, where the schema says too little
FIELDS: dict[str, Any] = {
    "model": "{mine}",
    "track": "oval",
    "racer": "bob",
    "race": "open-race",
    "url": "https://example.org/other",
    "claim": "{claim}",
    "reward_code": "def reward_function(params):\n    return 1.0\n",
    "csv": "guest,lap,time\nFred,1,12.5\n",
    "colour": "#112233",
    "number": 11,
    "variations_on": "oval",
}
# of operations whose fields depend on each other, by method and address
OPERATIONS: dict[str, dict[str, Any]] = {
    "PATCH /api/v1/races/{real}/laps/{lap}/": {"reason": "Seen", "time_ms": 10_500},
    "POST /api/v1/races/{show}/live/console/": {"action": "message", "message": "Hello", "version": "{version}"},
    "POST /api/v1/races/{show}/live/speed/": {"when": "start", "mode": "cap", "value": 2.0},
    "PATCH /api/v1/races/{show}/live/speed/": {"deputy": "bob"},
    "POST /api/v1/evaluations/": {"model": "{mine}", "track": "oval"},
    "POST /api/v1/sweeps/": {
        **{"name": "tune", "track": "oval", "reward_code": "def reward_function(params):\n    return 1.0\n"},
        **{"settings": 3, "budget_s": 60, "search": {"hyperparameters": {"lr": {"low": 0.0001, "high": 0.001}}}},
    },
    "POST /api/v1/models/": {"model": A_CAR[0], "metadata": A_CAR[1]},
    "POST /api/v1/reports/": {"model": "{mine}", "track_set": "chosen", "tracks": ["oval"]},
    "PATCH /api/v1/groups/{group}/members/{racer}/": {"role": "leader"},
    "POST /api/v1/groups/join/": {"code": "{group_code}"},
    "POST /api/v1/teams/join/": {"code": "{team_code}"},
    "POST /api/v1/classes/": {"name": "8a"},
    "POST /api/v1/assignments/": {
        **{"group": "7c", "title": "Second"},
        **{"opens_at": "2099-01-01T00:00:00Z", "due_at": "2099-01-08T00:00:00Z"},
    },
    "PATCH /api/v1/assignments/{assignment}/": {"title": "Renamed"},
    "PATCH /api/v1/classes/{class}/learners/{learner}/": {"student_id": "20261"},
    "POST /api/v1/assignments/{assignment}/extensions/": {"racer": "{learner}", "due_at": "2099-01-08T00:00:00Z"},
    "POST /api/v1/assignments/{assignment}/groups/": {"name": "Blue", "racers": ["{student}"]},
    "POST /api/v1/programs/": {"name": "other", "purpose": "Results", "owner": "alice"},
    "PATCH /api/v1/programs/{program}/": {"purpose": "Other results"},
}
# what buttons and scripts of pages send, and fields that a form leaves to the racer, by the address
PAGES: dict[str, dict[str, Any]] = {
    "/races/{show}/live/react/": {"kind": "clap"},
    "/races/{open}/submit/": {"model": "{mine}"},
    "/races/{secret}/submit/": {"model": "{mine}"},
    "/races/{secret}/cancel/": {"reason": "Rain"},
    "/cups/starter/": {"model": "{mine}"},
    "/groups/{group}/": {"do": "link"},
    "/programs/{program}/": {"action": "disable"},
    "/seasons/{season}/continues/": {"continues": "1"},
    "/settings/": {"country": "DE"},
    "/races/{show}/event/act/": {"action": "message", "message": "Hello", "version": "{version}"},
    "/races/{show}/event/mine/": {"here": "1"},
    "/models/upload/": {"files": A_CAR},
    "/runs/new/": {"model": "{mine}", "track": "oval"},
    "/reports/new/": {"model": "{mine}"},
}
READERS = ("organiser", "staff", "stranger", "guest")


def body_of_row(cast: Cast, row: Row, viewer: str) -> tuple[dict[str, Any], bool]:
    """A valid body for this viewer, and whether it is sent as a form."""
    if row.view is None:
        return _of_page(cast, row, viewer), True
    if (sent := OPERATIONS.get(f"{row.method} {row.address}")) is not None:
        body = {name: _worded(cast, value, viewer) for name, value in sent.items()}
        return body, any(isinstance(value, File) for value in body.values())
    taken = body_of(row.method.lower(), "/" + re.sub(r"<(?:\w+:)?(\w+)>", r"{\1}", row.route))
    if taken is None:
        return {}, False
    kind, schema = taken
    return _object(schema, lambda value: _worded(cast, value, viewer)), kind == "multipart/form-data"


def _of_page(cast: Cast, row: Row, viewer: str) -> dict[str, Any]:
    """What the form that goes to this address sends, from the same page, as the first reader who sees it there; with
    the fields of ``PAGES``."""
    address = cast.fill(row.address)
    if address not in cast.forms:
        cast.forms[address] = _shown_form(cast, address)
    more = PAGES.get(row.address, {})
    return cast.forms[address] | {name: _worded(cast, value, viewer) for name, value in more.items()}


def _shown_form(cast: Cast, address: str) -> dict[str, Any]:
    fill: dict[str, Any] = {}
    page = address
    for case in CASES:
        at = case.at.format(**cast.words)
        if at.partition("?")[0] == address:
            page = at
            fill |= {label: _worded(cast, value, "organiser") for label, value in case.fill.items()}
    for viewer in READERS:
        answer = cast.ask(viewer, "GET", page)
        if answer.status == "200" and not answer.response.streaming:
            sent = filled_form(address, answer.response.content.decode(errors="replace"), address, fill)
            if sent is not None:
                return sent
    return {}


def _worded(cast: Cast, value: Any, viewer: str) -> Any:
    """A value with the words of the cast, or the files that it describes."""
    if isinstance(value, str):
        return cast.fill(value, viewer) if value.startswith("{") else value
    if isinstance(value, list) and value and isinstance(value[0], str):
        return [_worded(cast, one, viewer) for one in value]
    files = [value] if isinstance(value, dict) else value
    if isinstance(files, list) and files and isinstance(files[0], dict) and "buffer" in files[0]:
        made = [SimpleUploadedFile(file["name"], file["buffer"], file["mimeType"]) for file in files]
        return made[0] if len(made) == 1 else made
    return "on" if value is True else value


def _object(schema: dict[str, Any], worded: Callable[[Any], Any]) -> dict[str, Any]:
    required = schema.get("required", ())
    return {name: _value(name, schema["properties"][name], worded) for name in required}


def _value(name: str, schema: dict[str, Any], worded: Callable[[Any], Any]) -> Any:
    if name in FIELDS:
        return worded(FIELDS[name])
    for inner in schema.get("allOf", schema.get("oneOf", ())):
        return _value(name, inner, worded)
    if "$ref" in schema:
        return _value(name, SCHEMA["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]], worded)
    if "enum" in schema:
        return schema["enum"][0]
    match schema.get("type"), schema.get("format"):
        case "object", _:
            return _object(schema, worded)
        case "array", _:
            return [_value(name, schema["items"], worded)]
        case (("integer" | "number"), _):
            return schema.get("minimum", 1)
        case "boolean", _:
            return True
        case _, "date-time":
            return (timezone.now() + timedelta(days=3 if "close" in name else 1)).isoformat()
        case _, "date":
            return str(timezone.now().date() + timedelta(days=900 if "end" in name else 800))
        case _, "uuid":
            return str(UUID(int=7))
        case _, "binary":
            file = A_TRACK if name == "file" else A_CAR[1] if name == "metadata" else A_CAR[0]
            return SimpleUploadedFile(file["name"], file["buffer"])
    return f"new-{name}"[: schema.get("maxLength", 64)].replace("_", "-")
