"""Look up the object of an operation for the request's racer before the body is read."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from rest_framework.request import Request

from core.api.bodies import refuse_fields

Handler = Callable[..., Any]


def finds(lookup: Callable[..., Any], *, fields: bool = True) -> Callable[[Handler], Handler]:
    """Pass a handler what ``lookup(request, **parameters of the address)`` returns, in place of these parameters.

    The lookup raises Http404, PermissionDenied or a UserFault before the body is read. ``fields``: whether the
    operation takes a body with fields."""

    def decorate(handler: Handler) -> Handler:
        @wraps(handler)
        def handle(view: Any, request: Request, **named: Any) -> Any:
            found = lookup(request, **named)
            if not fields:
                refuse_fields(request)
            return handler(view, request, found)

        handle.lookup = lookup  # type: ignore[attr-defined]
        handle.takes_fields = fields  # type: ignore[attr-defined]
        return handle

    return decorate
