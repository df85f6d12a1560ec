"""What drf-spectacular cannot know by itself: the one form of an error, and where which of them may come."""

from __future__ import annotations

from typing import Any

from drf_spectacular.openapi import AutoSchema

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

DESCRIPTIONS = {
    "400": "The input is refused: a reason code, or `invalid` with `fields`.",
    "401": "No valid token, and not logged in.",
    "403": "Seen, but not yours to change; or a session without its CSRF token.",
    "409": "Not now, or not again: it contradicts how things stand.",
    "404": "It does not exist, or you may not see it.",
    "429": "Too many requests; `Retry-After` says when to try again.",
    "default": "Any other failure, in the same form: 405, 406, 411, 413, 415, 500, 503.",
}


class Schema(AutoSchema):
    """Describes an operation in its own words only: a view's docstring is about all of its operations."""

    def get_description(self) -> str:
        return ""


def add_errors(result: dict[str, Any], generator: Any, request: Any, public: bool) -> dict[str, Any]:
    """A drf-spectacular postprocessing hook: describe the error responses of every operation."""
    result.setdefault("components", {}).setdefault("schemas", {})["Error"] = ERROR
    for path, operations in result["paths"].items():
        for method, operation in operations.items():
            _describe(operation, path, method)
    return result


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
    for code in sorted(possible):
        responses.setdefault(
            code,
            {
                "description": DESCRIPTIONS[code],
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}},
            },
        )
