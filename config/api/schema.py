"""What drf-spectacular cannot know by itself: the one form of an error, and where which of them may come."""

from __future__ import annotations

from typing import Any

from drf_spectacular.openapi import AutoSchema

from accounts.scopes import needed

WRITES = ("post", "put", "patch", "delete")

ERROR = {
    "type": "object",
    "description": "Every failure has this form.",
    "required": ["code", "message", "fault", "params"],
    "properties": {
        "code": {"type": "string", "description": "Stable; listed in the documentation."},
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

FRESHNESS = ("ETag", "Cache-Control")
LIMITS = ("RateLimit-Limit", "RateLimit-Remaining", "RateLimit-Reset")
HEADERS = {
    "ETag": ("string", "Send it back as `If-None-Match`: 304 while nothing has changed."),
    "Cache-Control": ("string", "Who may keep the answer. Nobody keeps what was said to you for others."),
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

DESCRIPTIONS = {
    "400": "The input is refused: a reason code, or `invalid` with `fields`.",
    "401": "No valid token, and not logged in.",
    "403": "Seen, but not yours to change; or a session without its CSRF token.",
    "409": "Not now, or not again: it contradicts how things stand.",
    "404": "Not found, or you have no access to it.",
    "429": "Too many requests; `Retry-After` says when to try again.",
    "default": "Any other failure, in the same form: 405, 406, 413, 415, 500, 503.",
}


class Schema(AutoSchema):
    """Describes an operation in its own words only: a view's docstring is about all of its operations."""

    def get_description(self, *_args: object) -> str:
        return ""

    def get_operation(self, *args: Any, **kwargs: Any) -> dict[str, Any] | None:
        """The operation, and which scopes a token needs for it (none for an operation that any token may use)."""
        operation = super().get_operation(*args, **kwargs)
        if operation and operation.get("security", [{}]) != [{}]:
            operation["x-token-scopes"] = list(needed(self.view, self.method))
        return operation


def add_errors(result: dict[str, Any], generator: Any, request: Any, public: bool) -> dict[str, Any]:
    """A drf-spectacular postprocessing hook: describe the error responses of every operation."""
    components = result.setdefault("components", {})
    components.setdefault("schemas", {})["Error"] = ERROR
    components["headers"] = {
        name: {"description": text, "schema": {"type": kind}} for name, (kind, text) in HEADERS.items()
    }
    result["x-webhooks"] = _webhooks()  # "webhooks" from OpenAPI 3.1 on
    for path, operations in result["paths"].items():
        for method, operation in operations.items():
            _describe(operation, path, method)
    return result


def _webhooks() -> dict[str, Any]:
    """What addresses are told, by event: a request that Paddock makes (Standard Webhooks)."""
    from league.happenings import EVENTS, LABELS, TEST

    return {event: {"post": _delivery(event, str(LABELS.get(event, "a test")))} for event in (*EVENTS, TEST)}


def _delivery(event: str, label: str) -> dict[str, Any]:
    body = {
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


def _describe(operation: dict[str, Any], path: str, method: str) -> None:
    writes = method in WRITES
    possible = {"default"}
    if writes or any(parameter["in"] == "query" for parameter in operation.get("parameters", ())):
        possible.add("400")
    if writes or {} not in operation.get("security", [{}]):
        possible |= {"401", "403"}
    if method in ("post", "patch"):
        possible.add("409")
    if "{" in path or any(parameter["name"] == "page" for parameter in operation.get("parameters", ())):
        possible.add("404")
    if writes:
        possible.add("429")
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


def _headers(method: str, code: str) -> dict[str, Any]:
    """What stands in the head of an answer: the middleware of :mod:`config.delivery` and the throttle write it."""
    names: tuple[str, ...] = ()
    if method == "get" and code in ("200", "304"):
        names = FRESHNESS
    elif method in WRITES and code != "401":
        names = LIMITS
    if code in ("429", "503"):
        names = (*names, "Retry-After")
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}
