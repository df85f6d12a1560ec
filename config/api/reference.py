"""The API's reference for people: a page drawn from the very schema that programs read, with nothing from elsewhere."""

from dataclasses import dataclass
from functools import lru_cache

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from core.addresses import origin_of

from .schema import WRITES, BodyPart, OperationPart, ParameterPart, SchemaDocument, SchemaPart
from .schema_view import schema_in

METHODS = ("get", *WRITES)
SUBJECTS = (
    *(
        "account",
        "programs",
        "groups",
        "teams",
        "classes",
        "assignments",
        "attempts",
        "notices",
        "webhooks",
        "models",
        "vehicles",
        "trainings",
    ),
    *(
        "sweeps",
        "tracks",
        "races",
        "timing",
        "cups",
        "following",
        "seasons",
        "evaluations",
        "reports",
        "audit",
        "status",
    ),
)


@dataclass(frozen=True)
class DocumentedField:
    """One parameter, or one field of a body. ``place`` is ``path``, ``query`` or ``body``."""

    name: str
    place: str
    kind: str
    required: bool
    description: str


@dataclass(frozen=True)
class Operation:
    anchor: str
    method: str
    path: str
    summary: str
    description: str
    needs_token: bool
    scopes: tuple[str, ...]
    body_type: str
    fields: tuple[DocumentedField, ...]
    answers: tuple[tuple[str, str], ...]


@require_safe
def page(request: HttpRequest) -> HttpResponse:
    return render(request, "config/api/reference.html", {"subjects": operations(), "origin": origin_of(request)})


def operations() -> tuple[tuple[str, tuple[Operation, ...]], ...]:
    """The operations of the schema by subject, in the order of their addresses, in the reader's language."""
    return _operations(get_language())


@lru_cache
def _operations(language: str) -> tuple[tuple[str, tuple[Operation, ...]], ...]:
    schema = schema_in(language)
    subjects: dict[str, list[Operation]] = {subject: [] for subject in SUBJECTS}
    for path, item in schema["paths"].items():
        for method in METHODS:
            if method in item:
                operation = item[method]
                subjects[operation["tags"][0]].append(_operation(schema, path, method, operation))
    return tuple((subject, tuple(rows)) for subject, rows in subjects.items())


def _operation(schema: SchemaDocument, path: str, method: str, operation: OperationPart) -> Operation:
    body_type, body = _first(operation.get("requestBody", {}).get("content", {}))
    shown = [parameter for parameter in operation.get("parameters", ()) if parameter["in"] != "header"]
    parameters = sorted(shown, key=lambda parameter: parameter["in"] != "path")
    return Operation(
        anchor=operation["operationId"],
        method=method.upper(),
        path=path,
        summary=operation.get("summary", ""),
        description=operation.get("description", ""),
        needs_token={} not in operation.get("security", [{}]),
        scopes=tuple(operation.get("x-token-scopes", ())),
        body_type=body_type,
        fields=(
            *(_field(schema, each["name"], each["in"], each["schema"], each) for each in parameters),
            *_body_fields(schema, body.get("schema", {})),
        ),
        answers=tuple(
            (code, _answer(response)) for code, response in operation["responses"].items() if code.startswith("2")
        ),
    )


def _body_fields(schema: SchemaDocument, body: SchemaPart) -> list[DocumentedField]:
    body = _resolved(schema, body)
    required = body.get("required", ())
    return [
        _field(schema, name, "body", each, {"required": name in required})
        for name, each in body.get("properties", {}).items()
    ]


def _field(
    schema: SchemaDocument, name: str, place: str, described: SchemaPart, outer: ParameterPart
) -> DocumentedField:
    return DocumentedField(
        name=name,
        place=place,
        kind=_kind(schema, described),
        required=bool(outer.get("required", False)),
        description=outer.get("description") or described.get("description", ""),
    )


def _kind(schema: SchemaDocument, described: SchemaPart) -> str:
    """A type in a word: ``integer``, ``date-time``, ``file``, or the values to choose from."""
    described = _resolved(schema, described)
    if "enum" in described:
        return " | ".join(str(value) for value in described["enum"])
    if described.get("format") == "binary":
        return "file"
    if described.get("type") == "array":
        return f"list of {_kind(schema, described.get('items', {}))}"
    return str(described.get("format") or described.get("type") or "any")


def _first(content: dict[str, ParameterPart]) -> tuple[str, ParameterPart]:
    for media, part in content.items():
        return media, part
    return "", {}


def _answer(response: BodyPart) -> str:
    """The name of a schema, a media type, or a description."""
    media, content = _first(response.get("content", {}))
    answer = content.get("schema", {})
    if "$ref" in answer:
        return answer["$ref"].rsplit("/", 1)[-1]
    return media or response.get("description", "")


def _resolved(schema: SchemaDocument, part: SchemaPart) -> SchemaPart:
    """``part`` itself, or what its reference points to (through the ``allOf`` that descriptions make)."""
    while True:
        if "$ref" in part:
            part = schema["components"]["schemas"][part["$ref"].rsplit("/", 1)[-1]]
        elif len(part.get("allOf", ())) == 1:
            part = part["allOf"][0]
        else:
            return part
