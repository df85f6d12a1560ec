"""Operations of the API: one declaration for the schema, the object looked up, the query, the body and the answer."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from django.http import HttpResponseBase
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework.permissions import SAFE_METHODS
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.serializers import Serializer

from .bodies import read_as, refuse_fields
from .pagination import Pages

Handler = Callable[..., Any]
ZIP = {(200, "application/zip"): OpenApiTypes.BINARY}


def csv_of(lines: str) -> dict[Any, Any]:
    """The responses of an operation that answers a CSV file of such lines."""
    return {(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description=lines)}


def operation(
    id: str,
    summary: str,
    *,
    find: Callable[..., Any] | None = None,
    query: type[Serializer] | None = None,
    body: type[Serializer] | None = None,
    answer: type[Serializer] | str | dict[Any, Any] = "No response body",
    many: bool = False,
    paged: bool = False,
    partial: bool = False,
    status: int = 200,
    **schema: Any,
) -> Callable[[Handler], Handler]:
    """Make a handler an operation: called with its view, the request, the found object, the read query and body.

    ``find``: takes the request and the parameters of the address, and raises Http404, PermissionDenied or a UserFault
    for a racer who may not use the operation, before query and body are read. ``body``: without one a write refuses
    all fields. ``partial``: required fields may be left out. ``answer``: the serializer of what the handler returns (a
    response is passed on), or what an answer 204 without a body means, or all responses for ``extend_schema``.
    ``many``: the handler returns a list; ``paged``: one that is answered in pages. ``schema``: more for
    ``extend_schema``.
    """
    if isinstance(answer, str):
        responses: dict[Any, Any] = {204: OpenApiResponse(description=answer)}
    elif isinstance(answer, dict):
        responses = answer
    else:
        responses = {status: answer(many=True) if many or paged else answer}
    if query is not None:
        schema["parameters"] = [*schema.get("parameters", ()), query]

    def decorate(handler: Handler) -> Handler:
        @extend_schema(operation_id=id, summary=summary, request=body, responses=responses, **schema)
        @wraps(handler)
        def handle(view: Any, request: Request, **named: Any) -> HttpResponseBase:
            arguments = list(named.values()) if find is None else [find(request, **named)]
            if query is not None:
                arguments.append(read_as(query, request.query_params))
            if body is not None:
                arguments.append(read_as(body, request.data, partial=partial))
            elif request.method not in SAFE_METHODS:
                refuse_fields(request)
            made = handler(view, request, *arguments)
            if isinstance(answer, str):
                return Response(status=204)
            if isinstance(made, HttpResponseBase):
                return made
            assert not isinstance(answer, dict), "the handler makes the response"
            pages = Pages() if paged else None
            rows = made if pages is None else pages.paginate_queryset(made, request, view=view)
            data: Any = answer(rows, many=many or paged, context={"request": request}).data
            return Response(data, status=status) if pages is None else pages.get_paginated_response(data)

        handle.lookup, handle.paged = find, paged  # type: ignore[attr-defined]
        return handle

    return decorate
