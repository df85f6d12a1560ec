"""Telemetry as JSON and as CSV."""

import csv
import io
import math
from collections.abc import Iterable, Sequence

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.utils.cache import patch_vary_headers
from django.views.decorators.http import require_safe

from core.forms import explain
from paddock.errors import UserFault
from races.replays.responses import document_response
from races.web.views import downloaded, finished_evaluation, too_many

from .document import DIGITS, TelemetryDocument, telemetry_document, telemetry_part
from .selectors import asked_laps

RATES = {"telemetry": "120/m"}
COLUMNS = ("run", "lap", "metres", "ms", "delta_ms", *DIGITS)


@require_safe
def telemetry(request: HttpRequest, public_id: str) -> HttpResponse:
    """The telemetry document (:mod:`races.telemetry.document`) of ``lap`` and of the runs ``with``."""
    if (late := too_many(request, "telemetry", RATES)) is not None:
        return late
    try:
        laps = asked_laps(request, finished_evaluation(request, public_id))
        response = document_response(request, *telemetry_part(laps))
    except UserFault as fault:
        return JsonResponse({"code": fault.code, "detail": str(explain(fault))}, status=fault.reason.status)
    patch_vary_headers(response, ("Accept-Language", "Cookie"))
    return response


@require_safe
def telemetry_csv(request: HttpRequest, public_id: str) -> HttpResponse:
    """The channels of the same laps, a row for each place of each run; ``from``, ``to``: only these metres."""
    if (late := too_many(request, "telemetry", RATES)) is not None:
        return late
    bounds = _metres(request.GET.get("from"), 0.0), _metres(request.GET.get("to"), math.inf)
    try:
        document = telemetry_document(asked_laps(request, finished_evaluation(request, public_id)))
    except UserFault as fault:
        return HttpResponse(explain(fault), status=fault.reason.status, content_type="text/plain; charset=utf-8")
    content = telemetry_rows(document, *bounds)
    return downloaded(content, f"{public_id}-telemetry.csv", "text/csv; charset=utf-8")


def telemetry_rows(document: TelemetryDocument, from_m: float = 0.0, to_m: float = math.inf) -> str:
    """A document's channels as CSV, between two places of a lap."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for run in document["runs"]:
        missing = [None] * len(document["metres"])
        channels: Iterable[Sequence] = (run[name] or missing for name in COLUMNS[3:])  # type: ignore[literal-required]
        for metres, ms, *values in zip(document["metres"], *channels, strict=True):
            if ms is not None and from_m <= metres <= to_m:
                writer.writerow((run["run"], run["lap"], metres, ms, *values))
    return out.getvalue()


def _metres(text: str | None, default: float) -> float:
    try:
        metres = float(text or default)
    except ValueError:
        return default
    return default if math.isnan(metres) else metres
