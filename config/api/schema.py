"""What drf-spectacular cannot know by itself: the one form of an error, and where which of them may come."""

from datetime import timedelta
from typing import Any, TypedDict

from drf_spectacular.openapi import AutoSchema

from accounts.scopes import needed
from core.api.idempotency import HEADER, KEPT, LONGEST, PATTERN, REPLAYED
from core.api.pagination import Pages
from paddock.errors.reasons import REASONS

# What the operations below an address are about, if not what its first part names
SUBJECTS = {
    "auth": "account",
    "invitations": "races",
    "me": "account",
    "racers": "following",
    "reward-functions": "trainings",
    "videos": "evaluations",
}
WRITES = ("post", "put", "patch", "delete")

# The parts of an OpenAPI document that are read or written here and in the reference
SchemaPart = TypedDict(
    "SchemaPart",
    {
        "$ref": str,
        "allOf": "list[SchemaPart]",
        "type": str,
        "format": str,
        "enum": list[str],
        "items": "SchemaPart",
        "properties": "dict[str, SchemaPart]",
        "additionalProperties": "SchemaPart",
        "required": list[str],
        "nullable": bool,
        "minLength": int,
        "maxLength": int,
        "pattern": str,
        "description": str,
        "x-reason-codes": dict[str, list[str]],
    },
    total=False,
)
ParameterPart = TypedDict(
    "ParameterPart",
    {"name": str, "in": str, "schema": SchemaPart, "description": str, "required": bool},
    total=False,
)


class BodyPart(TypedDict, total=False):
    """What a request or a response has; ``content``: by media type."""

    description: str
    content: dict[str, ParameterPart]
    headers: dict[str, dict[str, str]]
    required: bool


OperationPart = TypedDict(
    "OperationPart",
    {
        "operationId": str,
        "tags": list[str],
        "summary": str,
        "description": str,
        "security": list[dict[str, list[str]]],
        "parameters": list[ParameterPart],
        "requestBody": BodyPart,
        "responses": dict[str, BodyPart],
        "x-token-scopes": list[str],
    },
    total=False,
)
Operations = dict[str, OperationPart]  # by method


class ComponentsPart(TypedDict, total=False):
    schemas: dict[str, SchemaPart]
    headers: dict[str, ParameterPart]


SchemaDocument = TypedDict(
    "SchemaDocument",
    {"paths": dict[str, Operations], "components": ComponentsPart, "x-webhooks": dict[str, Operations]},
)

ERROR: SchemaPart = {
    "type": "object",
    "description": "Every failure has this form.",
    "required": ["code", "message", "fault", "params"],
    "properties": {
        "code": {"type": "string", "description": "Stable; the reason codes stand in `x-reason-codes`, by status."},
        "message": {"type": "string", "description": "What is wrong and what to do, in the reader's language."},
        "fault": {"type": "string", "enum": ["user", "platform"], "description": "Who has to change something."},
        "params": {"type": "object", "additionalProperties": {}, "description": "The values in the message."},
        "fields": {
            "type": "object",
            "description": "With the code `invalid`: what is wrong with which field; an empty name is the whole.",
            "additionalProperties": {
                "type": "array",
                "items": {
                    "type": "object",
                    "required": ["code", "message"],
                    "properties": {"code": {"type": "string"}, "message": {"type": "string"}},
                },
            },
        },
    },
}

NO_KEY = "tell_crossing"  # of a sensor, whose crossings have numbers
FRESHNESS = ("ETag", "Cache-Control")
LIMITS = ("RateLimit-Limit", "RateLimit-Remaining", "RateLimit-Reset")
HEADERS = {
    "ETag": (
        "string",
        "Send it back as `If-None-Match`: 304 while nothing has changed; with a write as `If-Match`: 412 once it has.",
    ),
    REPLAYED: ("string", "`true`: the stored answer to the same request before. Nothing was done again."),
    "Cache-Control": ("string", "The caches that may store the answer. No shared cache stores a private one."),
    "RateLimit-Limit": ("integer", "Requests of this kind that a racer may make in an hour."),
    "RateLimit-Remaining": ("integer", "How many of them are left."),
    "RateLimit-Reset": ("integer", "Seconds until one more is."),
    "Retry-After": ("integer", "Seconds to wait."),
}

SIGNED_BY = {
    "webhook-id": "The same whenever this delivery is tried again.",
    "webhook-timestamp": "When it was sent, seconds since 1970: refuse what is older than five minutes.",
    "webhook-signature": "v1 and the HMAC-SHA256 of id, timestamp and body, as Standard Webhooks has it.",
}

IF_MATCH: ParameterPart = {
    "name": "If-Match",
    "in": "header",
    "schema": {"type": "string"},
    "description": "The `ETag` of a GET of this address, or of the nearest one above it that has a GET: written only "
    "while that is unchanged. `*`: while it exists.",
}
IDEMPOTENCY_KEY: ParameterPart = {
    "name": HEADER,
    "in": "header",
    "schema": {"type": "string", "minLength": 1, "maxLength": LONGEST, "pattern": f"^{PATTERN}$"},
    "description": "A new one, such as a UUID, for each request that is to act once. The same request with the same "
    f"key within {KEPT // timedelta(hours=1)} hours gets the first answer again.",
}

DESCRIPTIONS = {
    "400": "The input is refused: a reason code, or `invalid` with `fields`.",
    "401": "No valid token, and not logged in.",
    "403": "Seen, but not yours to change; or a session without its CSRF token.",
    "409": "Not now, or not again: it contradicts how things stand.",
    "404": "Not found, or you have no access to it.",
    "413": "A file, or what it unpacks to, is too large.",
    "412": "Changed since the `ETag` that `If-Match` names. Nothing was written.",
    "422": "The `Idempotency-Key` came with another body before.",
    "429": "Too many requests; try again after the seconds in `Retry-After`.",
    "default": "Any other failure, in the same form: 405, 406, 409, 413, 415, 500, 503.",
}


class Schema(AutoSchema):
    """Describes an operation in its own words only: a view's docstring is about all of its operations."""

    def get_description(self, *_args: object) -> str:
        return ""

    def get_tags(self) -> list[str]:
        (first,) = super().get_tags()
        return [getattr(self.view, "tag", "") or SUBJECTS.get(first, first)]

    def _get_paginator(self) -> Pages | None:
        handler = getattr(self.view, self.method.lower(), None)
        return Pages() if getattr(handler, "paged", False) else None

    def get_operation(self, *args: Any, **kwargs: Any) -> dict[str, object] | None:
        """The operation, and which scopes a token needs for it (none for an operation that any token may use)."""
        operation = super().get_operation(*args, **kwargs)
        if operation and operation.get("security", [{}]) != [{}]:
            operation["x-token-scopes"] = list(needed(self.view, self.method))
        return operation


def add_errors(result: SchemaDocument, generator: object, request: object, public: bool) -> SchemaDocument:
    """A drf-spectacular postprocessing hook: describe the error responses of every operation."""
    components = result.setdefault("components", {})
    by_status: dict[str, list[str]] = {}
    for reason in sorted(REASONS.values(), key=lambda each: (each.status, each.code)):
        by_status.setdefault(str(reason.status), []).append(reason.code)
    components.setdefault("schemas", {})["Error"] = ERROR | {"x-reason-codes": by_status}
    components["headers"] = {
        name: {"description": text, "schema": {"type": kind}} for name, (kind, text) in HEADERS.items()
    }
    result["x-webhooks"] = _webhooks()  # "webhooks" from OpenAPI 3.1 on
    for path, operations in result["paths"].items():
        for method, operation in operations.items():
            _describe(operation, path, method)
            if method in WRITES and _has_etag(result["paths"], path):
                operation.setdefault("parameters", []).append(IF_MATCH)
                if method in ("put", "patch") and "get" in operations and "200" in operation["responses"]:
                    operation["responses"]["200"]["headers"]["ETag"] = {"$ref": "#/components/headers/ETag"}
    return result


def _has_etag(paths: dict[str, Operations], path: str) -> bool:
    """Whether this address, or one above it, is read with GET (:func:`core.api.views._readable`)."""
    while path.strip("/"):
        if "get" in paths.get(path, {}):
            return True
        path = path.rstrip("/").rpartition("/")[0] + "/"
    return False


def _webhooks() -> dict[str, Operations]:
    """The requests that Paddock sends to webhooks, by event (Standard Webhooks)."""
    from league.webhooks.payloads import EVENTS, LABELS, TEST

    return {event: {"post": _delivery(event, str(LABELS.get(event, "a test")))} for event in (*EVENTS, TEST)}


def _delivery(event: str, label: str) -> OperationPart:
    body: SchemaPart = {
        "type": "object",
        "required": ["type", "timestamp", "race", "data"],
        "properties": {
            "type": {"type": "string", "enum": [event]},
            "timestamp": {"type": "string", "format": "date-time"},
            "race": {"type": "object", "nullable": True, "description": "The race that it happened in, if any."},
            "data": {"type": "object", "additionalProperties": {}},
        },
    }
    return {
        "summary": label,
        "parameters": [
            {"name": name, "in": "header", "required": True, "schema": {"type": "string"}, "description": text}
            for name, text in SIGNED_BY.items()
        ],
        "requestBody": {"required": True, "content": {"application/json": {"schema": body}}},
        "responses": {"2XX": {"description": "Taken; anything else is tried again."}},
    }


def _describe(operation: OperationPart, path: str, method: str) -> None:
    writes = method in WRITES
    possible = {"default"}
    if writes or any(parameter["in"] == "query" for parameter in operation.get("parameters", ())):
        possible.add("400")
    if writes or {} not in operation.get("security", [{}]):
        possible |= {"401", "403"}
    if "multipart/form-data" in operation.get("requestBody", {}).get("content", {}):
        possible.add("413")
    if method == "post" and operation["operationId"] != NO_KEY:
        possible.add("422")
        operation.setdefault("parameters", []).append(IDEMPOTENCY_KEY)
    if "{" in path or any(parameter["name"] == "page" for parameter in operation.get("parameters", ())):
        possible.add("404")
    if writes:
        possible |= {"409", "412", "429"}
    responses = operation["responses"]
    if method == "get":
        responses.setdefault("304", {"description": "The same as `If-None-Match` names."})
    for code in sorted(possible):
        responses.setdefault(
            code,
            {
                "description": DESCRIPTIONS[code],
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}},
            },
        )
    for code, response in responses.items():
        headers = _headers(method, code)
        if headers:
            response.setdefault("headers", {}).update(headers)


def _headers(method: str, code: str) -> dict[str, dict[str, str]]:
    """The headers that :mod:`config.middleware.http_caching` and the throttle add to an answer."""
    names: tuple[str, ...] = ()
    if method == "get" and code in ("200", "304"):
        names = FRESHNESS
    elif method in WRITES and code != "401":
        names = (*LIMITS, REPLAYED) if method == "post" and code.startswith("2") else LIMITS
    if code in ("429", "503"):
        names = (*names, "Retry-After")
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}
