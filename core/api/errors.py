"""Every failure of the API in one form: ``{"code", "message", "fault", "params"}``, and ``"fields"`` for bad input.

``code`` is stable, ``message`` is for people and in their language, ``fault`` says whether the caller or Paddock is
to blame.
"""

from __future__ import annotations

import logging
import math
from typing import Any

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

from core.forms import explain
from core.nul import is_of_nul
from core.storage_faults import is_of_storage
from paddock.errors import PaddockError, PlatformFault

log = logging.getLogger(__name__)

RETRY_AFTER_S = 30

# Reason codes that are not plain bad input (400).
_FORBIDDEN = (
    "model_not_yours vehicle_not_yours clone_not_yours race_not_yours race_needs_invitation race_pro_only "
    "race_open_only race_league_admins race_terms entry_removed timing_not_yours timing_stewards"
)
_NOT_THERE = (
    "invitation_unknown entry_missing certificate_no_place race_has_no_duels guest_unknown timekeeper_unknown "
    "sensor_unknown"
)
_NOT_NOW = (
    "race_not_open_yet race_closed race_cancelled race_recorded race_has_opened race_is_over race_has_submissions "
    "race_changed_meanwhile race_limit season_changed_meanwhile season_is_official "
    "entry_withdrawn car_already_submitted car_of_another submission_running submissions_used_up submission_not_failed "
    "race_engine_gone results_not_yet highlights_none "
    "duels_before_closing duels_wait_for_qualifying duels_drawn "
    "track_known track_limit track_in_use garage_full storage_full model_name_taken too_many_tokens "
    "training_name_taken training_jobs_at_once training_minutes_left reward_check_runs "
    "vehicle_name_taken vehicle_limit training_no_model webhook_limit webhook_test_limit "
    "race_is_physical race_not_physical timing_final timing_too_late sessions_used_up guest_linked sensor_busy "
    "sensor_idle sensors_too_many timekeepers_too_many "
    "video_run_not_finished videos_off videos_at_once videos_a_day own_runs_at_once own_runs_a_day own_under_way"
)
STATUS_OF: dict[str, int] = {
    **dict.fromkeys(_FORBIDDEN.split(), status.HTTP_403_FORBIDDEN),
    **dict.fromkeys(_NOT_THERE.split(), status.HTTP_404_NOT_FOUND),
    **dict.fromkeys(_NOT_NOW.split(), status.HTTP_409_CONFLICT),
    "sensor_token": status.HTTP_401_UNAUTHORIZED,
    "sensor_revoked": status.HTTP_401_UNAUTHORIZED,
    "too_large": status.HTTP_413_REQUEST_ENTITY_TOO_LARGE,
}


class RequestTooLarge(exceptions.APIException):
    """The body of a request is larger than the operation reads."""

    status_code = status.HTTP_413_REQUEST_ENTITY_TOO_LARGE
    default_code = "request_too_large"
    default_detail = gettext_lazy("The request is too large. Send it in smaller parts.")


class Unavailable(exceptions.APIException):
    """The database or the broker does not answer now."""

    status_code = status.HTTP_503_SERVICE_UNAVAILABLE
    default_code = "unavailable"
    default_detail = gettext_lazy("Paddock is busy or restarting. Nothing was changed. Try again in a minute.")


class InternalError(exceptions.APIException):
    """A bug of ours."""

    default_code = "server_error"
    default_detail = gettext_lazy("Internal error. It is not your fault, and it is recorded in the operator's log.")


def handle(exc: Exception, context: dict[str, Any]) -> Response:
    """The response for ``exc`` (REST framework's EXCEPTION_HANDLER). Never gives up: the last answer is a 500."""
    headers: dict[str, str] = {}
    if is_of_storage(exc):
        log.error("The storage of files failed.", exc_info=exc)
        exc = PlatformFault("storage_failed")
    if isinstance(exc, PaddockError):
        set_rollback()
        code = _status_of(exc)
        if code == status.HTTP_503_SERVICE_UNAVAILABLE:
            headers["Retry-After"] = str(RETRY_AFTER_S)
        body = _body(exc.code, explain(exc), exc.fault, exc.params)
        if isinstance(errors := getattr(exc, "errors", None), DjangoValidationError):  # several problems, by field
            body["fields"] = _fields(exceptions.ValidationError(_messages(errors)).get_full_details())
        return Response(body, status=code, headers=headers)

    error = _as_api_exception(exc, context)
    set_rollback()
    params: dict[str, Any] = dict(getattr(error, "params", {}))
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
        body = _body("invalid", _summary(fields), fault, params) | {"fields": fields}
    else:
        name = error.get_codes()
        body = _body(name if isinstance(name, str) else error.default_code, str(error.detail), fault, params)
    return Response(body, status=error.status_code, headers=headers)


def _as_api_exception(exc: Exception, context: dict[str, Any]) -> exceptions.APIException:
    match exc:
        case exceptions.NotAuthenticated():
            exc.detail = exceptions.ErrorDetail(
                _(
                    "Authentication required: send the header Authorization: Token ... (create a token in "
                    "your settings)."
                ),
                str(exc.get_codes()),
            )
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
    request = context.get("request")
    if is_of_nul(exc):
        return exceptions.NotFound(_("Not found, or you have no access to it."))
    if isinstance(exc, (OperationalError, RedisError)):
        log.error("The database or the broker failed during an API request", exc_info=exc)
        return Unavailable()
    # What Django does for an uncaught error, but with an answer in the API's own form.
    log.error("An API request failed", exc_info=exc)
    got_request_exception.send(sender=None, request=getattr(request, "_request", request))
    return InternalError()


def _status_of(fault: PaddockError) -> int:
    if fault.fault == "platform":
        return status.HTTP_503_SERVICE_UNAVAILABLE
    return STATUS_OF.get(fault.code, status.HTTP_400_BAD_REQUEST)


def _body(code: str, message: str, fault: str, params: dict[str, Any]) -> dict[str, Any]:
    return {"code": code, "message": message, "fault": fault, "params": params}


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


def _fields(details: Any, name: str = "") -> dict[str, list[dict[str, str]]]:
    """Flatten nested validation details to ``{"track.name": [{"code", "message"}]}``; "" stands for the whole."""
    if _is_message(details):
        return {name: [{"code": str(details["code"]), "message": str(details["message"])}]}
    found: dict[str, list[dict[str, str]]] = {}
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


def _summary(fields: dict[str, list[dict[str, str]]]) -> str:
    """One line that names the first wrong field."""
    field, errors = next(iter(fields.items()), ("", []))
    message = errors[0]["message"] if errors else _("Some values are invalid.")
    return f"{field}: {message}" if field else message
