"""Operations of the API: one declaration for the schema, the object looked up, the body and the answer."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework.permissions import SAFE_METHODS
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.serializers import Serializer

from .bodies import read_as, refuse_fields

Handler = Callable[..., Any]


def operation(
    id: str,
    summary: str,
    *,
    find: Callable[..., Any] | None = None,
    body: type[Serializer] | None = None,
    answer: type[Serializer] | str = "No response body",
    many: bool = False,
    partial: bool = False,
    status: int = 200,
    **schema: Any,
) -> Callable[[Handler], Handler]:
    """Make a handler an operation: called with its view, the request, the found object and the read body.

    ``find``: takes the request and the parameters of the address, and raises Http404, PermissionDenied or a UserFault
    for a racer who may not use the operation, before the body is read. ``body``: without one a write refuses all
    fields. ``partial``: required fields may be left out. ``answer``: the serializer of what the handler returns (a
    Response is passed on), or what an answer 204 without a body means. ``schema``: more for ``extend_schema``.
    """
    if isinstance(answer, str):
        responses: dict[int, Any] = {204: OpenApiResponse(description=answer)}
    else:
        responses = {status: answer(many=True) if many else answer}

    def decorate(handler: Handler) -> Handler:
        @extend_schema(operation_id=id, summary=summary, request=body, responses=responses, **schema)
        @wraps(handler)
        def handle(view: Any, request: Request, **named: Any) -> Response:
            arguments = list(named.values()) if find is None else [find(request, **named)]
            if body is not None:
                arguments.append(read_as(body, request.data, partial=partial))
            elif request.method not in SAFE_METHODS:
                refuse_fields(request)
            made = handler(view, request, *arguments)
            if isinstance(answer, str):
                return Response(status=204)
            if isinstance(made, Response):
                return made
            return Response(answer(made, many=many, context={"request": request}).data, status=status)

        handle.lookup = find  # type: ignore[attr-defined]
        return handle

    return decorate
