"""The base of all operations: conditional writes (``If-Match``) and repeatable ones (``Idempotency-Key``)."""

import copy
from collections.abc import Callable
from functools import partial
from typing import Any

from django.db import OperationalError, connection, transaction
from django.http import HttpResponseBase, QueryDict
from django.urls import Resolver404, ResolverMatch, resolve
from django.utils import timezone
from django.utils.cache import get_conditional_response, set_response_etag
from django.utils.http import parse_etags
from rest_framework.exceptions import APIException
from rest_framework.permissions import SAFE_METHODS, IsAuthenticated
from rest_framework.renderers import BaseRenderer, JSONRenderer
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView as PlainView

from .errors import PreconditionFailed
from .idempotency import Repeat, repeat_of

CONDITIONS = ("HTTP_IF_MATCH", "HTTP_IF_NONE_MATCH")
_SERIALIZATION_FAILURE = "40001"


class APIView(PlainView):
    """A view of the API.

    A write with a condition or an idempotency key runs in one transaction with the check and the stored answer.
    Handlers of ``slow_methods`` do slow work first and pass the rest to :meth:`write` themselves."""

    tag = ""
    slow_methods: tuple[str, ...] = ()
    _repeat: Repeat | None = None

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> None:
        """Wrap the handler of a write: REST framework looks it up on the instance after this."""
        super().initial(request, *args, **kwargs)
        method = request.method or ""
        handler = getattr(self, method.lower(), None)
        if method in SAFE_METHODS or handler is None:
            return
        wrapped = self._slow if method in self.slow_methods else self._write
        setattr(self, method.lower(), partial(wrapped, handler))

    def write(self, make: Callable[[], Response], *, racer: Any = None) -> Response:
        """The response of ``make``, or the stored one of the same request before.

        ``racer``: the key's owner, if not the request's user. Raises PreconditionFailed and the errors of
        :mod:`.idempotency`."""
        repeat = self._repeat or repeat_of(self.request, racer or self.request.user)
        is_conditional = _is_conditional(self.request)
        if repeat is None and not is_conditional:
            return make()
        is_outermost = not connection.in_atomic_block
        try:
            with transaction.atomic():
                if is_conditional and is_outermost and connection.vendor == "postgresql":
                    with connection.cursor() as cursor:  # what others commit after the check makes this one fail
                        cursor.execute("SET TRANSACTION ISOLATION LEVEL SERIALIZABLE")
                return self._checked(make, repeat, is_conditional)
        except OperationalError as error:
            if is_conditional and getattr(error.__cause__, "sqlstate", "") == _SERIALIZATION_FAILURE:
                raise PreconditionFailed() from error
            raise

    def _checked(self, make: Callable[[], Response], repeat: Repeat | None, is_conditional: bool) -> Response:
        if repeat is not None:
            repeat.hold()
            if (stored := repeat.stored()) is not None:
                return stored
        holds = not is_conditional or self._condition_holds()
        response = make()  # what is not there or not theirs is refused as without a condition
        if not holds and response.status_code < 400:
            raise PreconditionFailed()
        if repeat is not None:
            repeat.keep(response, now=timezone.now())
        return response

    def _write(self, handler: Callable[..., Response], request: Request, *args: Any, **kwargs: Any) -> Response:
        self._repeat = _repeat_after_access(handler, request, kwargs)
        response = self.write(lambda: handler(request, *args, **kwargs))
        if request.method in ("PATCH", "PUT") and response.status_code == 200 and hasattr(self, "get"):
            shown = _current(request)
            if shown is not None and getattr(shown, "content", None) == JSONRenderer().render(response.data):
                response["ETag"] = shown["ETag"]
        return response

    def _slow(self, handler: Callable[..., Response], request: Request, *args: Any, **kwargs: Any) -> Response:
        self._repeat = _repeat_after_access(handler, request, kwargs)
        stored = None if self._repeat is None else self._repeat.stored()
        if stored is not None:
            return stored
        if _is_conditional(request):
            self._condition_holds()
        return handler(request, *args, **kwargs)

    def _condition_holds(self) -> bool:
        """Raises PreconditionFailed for what may be read and is not what the condition names."""
        current = _current(self.request)
        etag = None if current is None else current.get("ETag")
        sent = self.request.headers.get("If-Match")
        names_none = sent is not None and not parse_etags(sent)  # which Django reads as no condition
        holds = not names_none and get_conditional_response(self.request._request, etag=etag) is None
        if not holds and current is not None and current.status_code == 200:
            raise PreconditionFailed()
        return holds


class PrivateView(APIView):
    """A view that guests cannot even read."""

    permission_classes = [IsAuthenticated]


class FileRenderer(BaseRenderer):
    """Lets a program ask for a kind of file by ``Accept``; the view itself writes it, so nothing is ever rendered."""

    charset = None

    def __init__(self, media_type: str) -> None:
        self.media_type = media_type
        self.format = media_type.rpartition("/")[2]


class FileView(APIView):
    """A view whose GET answers with a file of :attr:`media_type`; failures and other methods answer in JSON."""

    media_type = "application/zip"

    def get_renderers(self) -> list[BaseRenderer]:
        return [JSONRenderer(), FileRenderer(self.media_type)]

    def perform_content_negotiation(self, request: Request, force: bool = False) -> tuple[BaseRenderer, str]:
        if request.method not in ("GET", "HEAD"):
            return JSONRenderer(), JSONRenderer.media_type
        return super().perform_content_negotiation(request, force)

    def handle_exception(self, exc: Exception) -> Response:
        self.request.accepted_renderer, self.request.accepted_media_type = JSONRenderer(), JSONRenderer.media_type
        return super().handle_exception(exc)


def _repeat_after_access(handler: Callable[..., Response], request: Request, named: dict[str, object]) -> Repeat | None:
    """As :func:`repeat_of`. What is wrong with key and body is for racers who may use the operation."""
    try:
        return repeat_of(request, request.user)
    except APIException:
        if (lookup := getattr(handler, "lookup", None)) is not None:
            lookup(request, **named)
        raise


def _is_conditional(request: Request) -> bool:
    return any(name in request._request.META for name in CONDITIONS)


def _current(request: Request) -> HttpResponseBase | None:
    """The answer to a GET of the same address, or of the nearest one above with a GET; None without either."""
    http = request._request
    found = _readable(http.path_info)
    if found is None:
        return None
    path, match = found
    reading = copy.copy(http)
    reading.method, reading.resolver_match = "GET", match
    reading.META = {name: value for name, value in http.META.items() if name not in CONDITIONS}
    reading.META["REQUEST_METHOD"] = "GET"
    if path != http.path_info:
        reading.path = reading.path_info = reading.META["PATH_INFO"] = path
        reading.GET, reading.META["QUERY_STRING"] = QueryDict(""), ""
    # authenticated already, whatever its token's scopes
    reading._force_auth_user, reading._force_auth_token = request.user, request.auth  # type: ignore[attr-defined]
    response = match.func(reading, *match.args, **match.kwargs)
    if isinstance(response, Response):
        response.render()
    if response.status_code == 200 and not response.has_header("ETag"):
        set_response_etag(response)
    return response


def _readable(path: str) -> tuple[str, ResolverMatch] | None:
    """The address, or the nearest one above it, whose view has a GET."""
    while path.strip("/"):
        try:
            match = resolve(path)
        except Resolver404:
            return None
        if hasattr(getattr(match.func, "cls", None), "get"):
            return path, match
        path = path.rstrip("/").rpartition("/")[0] + "/"
    return None
