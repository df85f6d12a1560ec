"""Every failure of the API in one form: ``{"code", "message", "fault", "params"}``, and ``"fields"`` for bad input."""

import logging
import math
from collections.abc import Mapping
from typing import Any, NotRequired, TypedDict

from django.core.exceptions import NON_FIELD_ERRORS, PermissionDenied, RequestDataTooBig, SuspiciousOperation
from django.core.exceptions import ValidationError as DjangoValidationError
from django.core.signals import got_request_exception
from django.db import OperationalError
from django.http import Http404
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from redis.exceptions import RedisError
from rest_framework import exceptions, status
from rest_framework.response import Response
from rest_framework.views import set_rollback

from core.files.storage_faults import is_of_storage
from core.forms import explain
from core.validators import is_of_nul
from paddock.errors import PaddockError, PlatformFault

log = logging.getLogger(__name__)

RETRY_AFTER_S = 30
Fields = dict[str, list[dict[str, str]]]


class ErrorBody(TypedDict):
    """The answer to a failed request. ``fields``: what is wrong with the input, by field."""

    code: str
    message: str
    fault: str
    params: Mapping[str, object]
    fields: NotRequired[Fields]


class RequestTooLarge(exceptions.APIException):
    """The body of a request is larger than the operation reads."""

    status_code, default_code = status.HTTP_413_REQUEST_ENTITY_TOO_LARGE, "request_too_large"
    default_detail = gettext_lazy("The request is too large. Send it in smaller parts.")


class PreconditionFailed(exceptions.APIException):
    """The resource is not, or no longer, what ``If-Match`` names."""

    status_code, default_code = status.HTTP_412_PRECONDITION_FAILED, "precondition_failed"
    default_detail = gettext_lazy("Changed since you read it. Nothing was written. Read it again, then retry.")


class KeyInvalid(exceptions.APIException):
    """An idempotency key that is empty, too long or not visible ASCII."""

    status_code, default_code = status.HTTP_400_BAD_REQUEST, "idempotency_key_invalid"
    default_detail = gettext_lazy("Idempotency-Key takes 1 to 255 visible ASCII characters, for example a UUID.")


class KeyReused(exceptions.APIException):
    """An idempotency key that came with another request before."""

    status_code, default_code = status.HTTP_422_UNPROCESSABLE_ENTITY, "idempotency_key_reused"
    default_detail = gettext_lazy("This Idempotency-Key was used with another body. Use a new key for a new request.")


class KeyInUse(exceptions.APIException):
    """The first request with an idempotency key is still being answered."""

    status_code, default_code = status.HTTP_409_CONFLICT, "idempotency_key_in_use"
    default_detail = gettext_lazy("The first request with this Idempotency-Key is still running. Retry in a second.")
    wait = 1


class Unavailable(exceptions.APIException):
    """The database or the broker does not answer now."""

    status_code, default_code = status.HTTP_503_SERVICE_UNAVAILABLE, "unavailable"
    default_detail = gettext_lazy("Paddock is busy or restarting. Nothing was changed. Try again in a minute.")


class InternalError(exceptions.APIException):
    default_code = "server_error"
    default_detail = gettext_lazy("Internal error. It is not your fault, and it is recorded in the operator's log.")


def handle(exc: Exception, context: dict[str, object]) -> Response:
    """The response for ``exc`` (REST framework's EXCEPTION_HANDLER). Never gives up: the last answer is a 500."""
    response = _response(exc, context.get("request"))
    # Django writes no second line for what is logged here
    response._has_been_logged = response.status_code >= status.HTTP_500_INTERNAL_SERVER_ERROR  # type: ignore[attr-defined]
    return response


def _response(exc: Exception, request: object) -> Response:
    headers: dict[str, str] = {}
    if is_of_storage(exc):
        log.error("The storage of files failed.", exc_info=exc)
        exc = PlatformFault("storage_failed")
    if isinstance(exc, PaddockError):
        set_rollback()
        if exc.reason.status in (status.HTTP_429_TOO_MANY_REQUESTS, status.HTTP_503_SERVICE_UNAVAILABLE):
            headers["Retry-After"] = str(exc.params.get("wait_s", RETRY_AFTER_S))
        body = ErrorBody(code=exc.code, message=explain(exc), fault=exc.fault, params=exc.params)
        if isinstance(errors := getattr(exc, "errors", None), DjangoValidationError):  # several problems, by field
            body["fields"] = _fields(exceptions.ValidationError(_messages(errors)).get_full_details())
        return Response(body, status=exc.reason.status, headers=headers)

    error = _as_api_exception(exc, request)
    set_rollback()
    params = dict(getattr(error, "params", {}))
    if scheme := getattr(error, "auth_header", None):
        headers["WWW-Authenticate"] = scheme
    if wait_s := getattr(error, "wait", None):
        params["wait_s"] = math.ceil(wait_s)
        headers["Retry-After"] = str(params["wait_s"])
    elif isinstance(error, Unavailable):
        headers["Retry-After"] = str(RETRY_AFTER_S)
    fault = "platform" if error.status_code >= 500 else "user"

    if isinstance(error, exceptions.ValidationError):
        fields = _fields(error.get_full_details())
        body = ErrorBody(code="invalid", message=_summary(fields), fault=fault, params=params, fields=fields)
    else:
        name = error.get_codes()
        code = name if isinstance(name, str) else error.default_code
        body = ErrorBody(code=code, message=str(error.detail), fault=fault, params=params)
    return Response(body, status=error.status_code, headers=headers)


def _as_api_exception(exc: Exception, request: object) -> exceptions.APIException:
    match exc:
        case exceptions.NotAuthenticated():
            text = _(
                "Authentication required: send the header Authorization: Token ... (create a token in your settings)."
            )
            exc.detail = exceptions.ErrorDetail(text, str(exc.get_codes()))
            return exc
        case exceptions.APIException():
            return exc
        case Http404():
            return exceptions.NotFound(_("Not found, or you have no access to it."))
        case PermissionDenied():
            return exceptions.PermissionDenied()
        case RequestDataTooBig():
            return RequestTooLarge()
        case SuspiciousOperation():  # too many fields or files in a form
            return exceptions.ParseError()
        case RecursionError():
            return exceptions.ParseError(_("The JSON is nested too deeply."))
        case DjangoValidationError():
            return exceptions.ValidationError(_messages(exc))
    if is_of_nul(exc):
        return exceptions.NotFound(_("Not found, or you have no access to it."))
    if isinstance(exc, (OperationalError, RedisError)):
        log.error("The database or the broker failed during an API request", exc_info=exc)
        return Unavailable()
    # What Django does for an uncaught error, but with an answer in the API's own form.
    log.error("An API request failed", exc_info=exc)
    got_request_exception.send(sender=None, request=getattr(request, "_request", request))
    return InternalError()


def _messages(exc: DjangoValidationError) -> dict | list:
    """The same messages with their codes, as REST framework keeps them."""
    if hasattr(exc, "error_dict"):
        return {
            "" if field == NON_FIELD_ERRORS else field: _messages(DjangoValidationError(errors))
            for field, errors in exc.error_dict.items()
        }
    return [
        exceptions.ErrorDetail(message, code=error.code or "invalid")
        for error in exc.error_list
        for message in error.messages
    ]


def _fields(details: Any, name: str = "") -> Fields:
    """Flatten nested validation details to ``{"track.name": [{"code", "message"}]}``; "" stands for the whole."""
    if _is_message(details):
        return {name: [{"code": str(details["code"]), "message": str(details["message"])}]}
    found: Fields = {}
    if isinstance(details, dict):
        parts = [("" if key == "non_field_errors" else str(key), value) for key, value in details.items()]
    else:
        parts = [("" if _is_message(value) else str(index), value) for index, value in enumerate(details)]
    for key, value in parts:
        for field, errors in _fields(value, ".".join(part for part in (name, key) if part)).items():
            found.setdefault(field, []).extend(errors)
    return found


def _is_message(details: Any) -> bool:
    """A leaf, and not two fields that are called so."""
    return isinstance(details, dict) and set(details) == {"message", "code"} and isinstance(details["message"], str)


def _summary(fields: Fields) -> str:
    """One line that names the first wrong field."""
    field, errors = next(iter(fields.items()), ("", []))
    message = errors[0]["message"] if errors else _("Some values are invalid.")
    return f"{field}: {message}" if field else message
