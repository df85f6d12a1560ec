"""The car's camera frame at a moment of a run, and its network's output."""

from dataclasses import dataclass

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils.cache import get_conditional_response
from django.utils.http import quote_etag
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from accounts.request_racer import racer_of
from core.pages.faults import fault_text, report_fault
from evaluation.camera_replay.replay import CAMERA, Moment, SeenRun, probabilities, seen_run
from evaluation.models import Evaluation
from evaluation.selectors import can_see_model
from paddock.errors import PaddockError, UserFault

from ...web.views import finished_evaluation, too_many

SEEN_FORMAT = 1
RATES = {"seen_frame": "600/m", "seen_page": "60/m", "attention": "40/m"}  # a replay asks for three frames a second
_MOST_MS = 10**8
_STEP_MS = 1000 / 15


@dataclass(frozen=True)
class Bar:
    """A bar of one action or of one value of a continuous space; ``share``: 0 to 100."""

    label: str
    share: float
    value_text: str
    chosen: bool


@require_safe
def evaluation_seen(request: HttpRequest, public_id: str) -> HttpResponse:
    """The frame (PNG) at ``ms`` of the run or of its ``lap``, or at ``step``; ``car``: that of another car of it."""
    if (late := too_many(request, "seen_frame", RATES)) is not None:
        return late
    shown, number = _finished(request, public_id)
    run, moment = _there(request, shown, number)
    sensors = _sensors(request, shown, number)
    etag = quote_etag(f"{run.trace_sha256[:32]}-{moment.step}-{'-'.join(sensors)}-{SEEN_FORMAT}")
    response = get_conditional_response(request, etag=etag)
    if response is None:
        response = HttpResponse(run.picture(moment.step, sensors), content_type="image/png")
    response["ETag"] = etag
    response["Cache-Control"] = "private, max-age=600"
    return response


@require_safe
def evaluation_saw(request: HttpRequest, public_id: str) -> HttpResponse:
    """The frame with the moments before and after it, and the network's output for users of the model."""
    asks_where = "where" in request.GET
    if (late := too_many(request, "attention" if asks_where else "seen_page", RATES)) is not None:
        return late
    shown, number = _finished(request, public_id)
    try:
        run, moment = _looked_at(request, shown, number)
    except UserFault as fault:
        report_fault(request, fault)
        return redirect("evaluation", public_id)
    context = {
        "evaluation": shown,
        "car": number,
        "moment": moment,
        "frame": f"{reverse('evaluation_seen', args=[public_id])}?step={moment.step}&car={number}",
        "in_lap_ms": max(0, moment.ms - run.start_of(moment.lap)),
        "laps": run.laps,
        "steps": _steps(run, moment),
        "bars": [],
        "fault": "",
        "may_ask": _may_ask(request, shown, number),
        "has_camera": run.has_camera,
        "attention": "",
    }
    if context["may_ask"] and moment.asked:
        try:
            context["bars"] = _bars(
                run, moment, run.answers(moment.lap, racer_pk=racer_of(request).pk).get(moment.step)
            )
            if asks_where and run.has_camera:
                run.attention(moment.step, racer_pk=racer_of(request).pk)
                context["attention"] = (
                    f"{reverse('evaluation_attention', args=[public_id])}?step={moment.step}&car={number}"
                )
        except PaddockError as fault:
            context["fault"] = fault_text(fault)
    response = render(request, "races/runs/camera.html", context)
    response["Cache-Control"] = "private, no-store"
    return response


@require_safe
def evaluation_attention(request: HttpRequest, public_id: str) -> HttpResponse:
    """The frame (PNG) at ``step``, the redder the more a place matters to the network: for users of the model."""
    if (late := too_many(request, "attention", RATES)) is not None:
        return late
    shown, number = _finished(request, public_id)
    run, moment = _there(request, shown, number)
    if not (_may_ask(request, shown, number) and moment.asked and run.has_camera):
        raise Http404
    response = HttpResponse(run.attention(moment.step, racer_pk=racer_of(request).pk), content_type="image/png")
    response["Cache-Control"] = "private, max-age=600"
    return response


def _finished(request: HttpRequest, public_id: str) -> tuple[Evaluation, int]:
    number = request.GET.get("car", "0")
    shown = finished_evaluation(request, public_id)
    return shown, int(number) if number.isascii() and number.isdecimal() and len(number) < 3 else -1


def _may_ask(request: HttpRequest, shown: Evaluation, number: int) -> bool:
    """Whether the reader may see the sensors and output of the car's network: its users and admins."""
    if not request.user.is_authenticated:
        return False
    model = shown.model if not number else shown.rivals.select_related("model__owner").get(number=number).model
    return request.user.is_staff or can_see_model(request.user, model)


def _sensors(request: HttpRequest, shown: Evaluation, number: int) -> list[str]:
    if not _may_ask(request, shown, number):
        return list(CAMERA)
    metadata = shown.spec["metadata"] if not number else shown.rivals.get(number=number).metadata
    return sorted(metadata["sensor"])


def _looked_at(request: HttpRequest, shown: Evaluation, number: int) -> tuple[SeenRun, Moment]:
    """The car and the moment that the address names. Raises UserFault ``car_number``, ``seen_lap``."""

    def number_of(name: str) -> int | None:
        text = request.GET.get(name, "")
        return min(int(text), _MOST_MS) if text.isascii() and text.isdecimal() and len(text) < 12 else None

    run, step, lap = seen_run(shown, number), number_of("step"), number_of("lap")
    return run, run.moment(step) if step is not None else run.at(number_of("ms") or 0, lap)


def _there(request: HttpRequest, shown: Evaluation, number: int) -> tuple[SeenRun, Moment]:
    """The same for a picture, which has no words for a fault: Http404."""
    try:
        return _looked_at(request, shown, number)
    except UserFault as fault:
        raise Http404 from fault


def _steps(run: SeenRun, moment: Moment) -> list[tuple[str, str, int]]:
    """The moments that the page leads to: sign, words, step."""
    second = round(1000 / _STEP_MS)
    ways = (
        ("«", _("A second before"), -second),
        ("‹", _("A step before"), -1),
        ("›", _("A step after"), 1),
        ("»", _("A second after"), second),
    )
    return [(sign, words, run.moment(moment.step + by).step) for sign, words, by in ways]


def _bars(run: SeenRun, moment: Moment, values: list[float] | None) -> list[Bar]:
    if values is None:
        return []
    space = run.space
    if space.kind == "discrete":
        return [
            Bar(
                f"{_signed(steering)}° · {speed:g} m/s",
                100 * share,
                f"{100 * share:.1f} %",
                index == moment.index,
            )
            for index, ((steering, speed), share) in enumerate(zip(space.actions, probabilities(values), strict=True))
        ]
    chosen = ((_("Steering"), "°", moment.steering), (_("Speed"), " m/s", moment.speed))
    bars = []
    word = _("mean")  # not within the f-string, which makemessages does not read
    for (name, unit, value), mean, (low, high) in zip(chosen, values, (space.steering, space.speed), strict=True):
        share = 100 * (min(max(value, low), high) - low) / (high - low)
        value_text = f"{value:g}{unit} ({low:g} – {high:g}; {word} {mean:+.3f})"
        bars.append(Bar(name, share, value_text, True))
    return bars


def _signed(degrees: float) -> str:
    """Degrees with their sign, none for straight on."""
    return f"{degrees:+g}".replace("-", "−") if degrees else "0"
