"""Videos of a run: ask for one, see how far it is, watch it."""

from django.conf import settings
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase, QueryDict
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.http import urlencode
from django.views.decorators.http import require_POST, require_safe
from django_htmx.middleware import HtmxDetails

from accounts.request_racer import racer_of
from core.pages.faults import fault_text, report_fault
from core.pages.live_parts import live_part
from evaluation.models import Evaluation
from evaluation.running.competitors import CompetitorRow
from paddock.errors import PaddockError
from videos.models import WHOLE, Video, VideoCamera, VideoFormat, VideoState
from videos.responses import page_language, ready_video, video_response, visible_video
from videos.scenes import ClipForm, VideoRun, best_lap
from videos.selectors import ShownVideo, best_shown, can_request_video, can_stop_video, shown_video, videos_of
from videos.services import request_video, stop_video

from ...web.views import visible_evaluation

CARD = "races/runs/video.html"
FIELDS = ("what", "camera", "format", "from", "to")  # of the form
_AT = {
    "video_moment_order": "to",
    "video_animation_too_long": "format",
    "video_camera": "camera",
    "video_format": "format",
}  # the field that a refusal is shown at


class HtmxRequest(HttpRequest):
    """A request as the middleware of django-htmx hands it on."""

    htmx: HtmxDetails


@login_required
@require_POST
def evaluation_video(request: HtmxRequest, public_id: str) -> HttpResponse:
    """Request a video of a run: ``what`` is a car's number and a part of the run, such as ``0:best``."""
    evaluation = visible_evaluation(request, public_id)
    if not can_request_video(request.user, evaluation):
        raise Http404
    car, part = _car_and_part(request.POST)
    try:
        asked = request_video(
            evaluation=evaluation,
            by=racer_of(request),
            car=car,
            part=part,
            language=page_language(),
            now=timezone.now(),
            form=_form(request.POST),
        )
    except PaddockError as fault:
        if request.htmx:
            return _card(request, evaluation, None, fault)
        if not _at_field(fault, request.POST):
            report_fault(request, fault)
        return redirect(f"{evaluation.get_absolute_url()}?{urlencode(_typed(request.POST))}#video")
    return _card(request, evaluation, asked.video) if request.htmx else redirect(asked.video)


def _form(typed: QueryDict) -> ClipForm:
    """The camera, the format and the moment (seconds from ``from`` to ``to``) that a form asks for."""
    start, end = (_milliseconds(typed.get(name, "")) for name in ("from", "to"))
    return ClipForm(start, end, typed.get("camera", "follow"), typed.get("format", "mp4"))


def _car_and_part(typed: QueryDict) -> tuple[int, str]:
    car, _, part = typed.get("what", "").partition(":")
    return int(car[:4]) if car.isascii() and car.isdecimal() else 0, part or "best"


def _typed(query: QueryDict) -> dict[str, str]:
    """The fields of the form, where the query has any."""
    return {name: query.get(name, "")[:40] for name in FIELDS if name in query}


def _at_field(fault: PaddockError, typed: QueryDict) -> str:
    """The field that a refusal is shown at; "" for none."""
    if fault.code == "video_moment":
        return "from" if _form(typed).from_ms < 0 else "to"
    return _AT.get(fault.code, "")


def _fault_of(run: VideoRun, typed: QueryDict) -> PaddockError | None:
    """Why a clip with these fields would be refused; None unless the form has a field for it."""
    try:
        car, part = _car_and_part(typed)
        _form(typed).checked(run, car, run.part(car, part))
    except PaddockError as fault:
        return fault if _at_field(fault, typed) else None
    return None


def _milliseconds(text: str) -> int:
    """Seconds as typed, with a point or a comma; 0 for none, and beyond every run for what is no number."""
    try:
        return round(float(text.replace(",", ".") or 0) * 1000)
    except (ValueError, OverflowError):
        return -1


@require_safe
def video_live(request: HttpRequest, public_id: str) -> HttpResponse:
    """The changing part of the card while a video waits or is drawn; the whole card once it is done."""
    video = visible_video(request.user, public_id)
    shown = shown_video(video)
    if video.is_under_way:
        context = {"shown": shown, "can_stop_video": can_stop_video(request.user, video)}
        return live_part(request, shown.mark, "races/runs/video_now.html", lambda: context)
    evaluation = visible_evaluation(request, video.evaluation.public_id)
    return live_part(request, shown.mark, CARD, lambda: _card_context(request, evaluation, video), "#video")


@login_required
@require_POST
def video_stop(request: HtmxRequest, public_id: str) -> HttpResponse:
    video = visible_video(request.user, public_id)
    if video.is_under_way:
        if not can_stop_video(request.user, video):
            raise Http404
        stop_video(video=video, now=timezone.now())
    if request.htmx:
        return _card(request, visible_evaluation(request, video.evaluation.public_id), video)
    return redirect(video)


@require_safe
def video_file(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """The file, whole or in parts; with ``download`` as a file that is named after the run."""
    video = ready_video(request.user, public_id)
    return video_response(request, video, download="download" in request.GET)


@require_safe
def video_poster(request: HttpRequest, public_id: str) -> HttpResponseBase:
    return video_response(request, ready_video(request.user, public_id), still=True)


def video_context(request: HttpRequest, evaluation: Evaluation, cars: list[CompetitorRow] | None = None) -> dict:
    """The context of the card on a finished run's page. ``?video=`` selects one of several."""
    run = VideoRun.of(evaluation, cars)
    videos = videos_of(run)
    chosen = request.GET.get("video")
    shown = next((each for each in videos if each.video.public_id == chosen), None)
    card = _of_card(request, run, videos, shown or best_shown(videos, page_language(), request.user))
    return card | _refilled(request.GET, run, _fault_of(run, request.GET)) if "what" in request.GET else card


def _card(
    request: HttpRequest, evaluation: Evaluation, video: Video | None, fault: PaddockError | None = None
) -> HttpResponse:
    context = _card_context(request, evaluation, video)
    if fault is not None:
        context |= _refilled(request.POST, VideoRun.of(evaluation), fault)
    return render(request, CARD, context)


def _refilled(query: QueryDict, run: VideoRun, fault: PaddockError | None) -> dict:
    """What the form has with the fields of a query, and a refusal at its field."""
    car, part = _car_and_part(query)
    try:
        chosen = {"preselected": (car, run.part(car, part))}
    except PaddockError:
        chosen = {}
    at = _at_field(fault, query) if fault else ""
    return chosen | {"video_typed": _typed(query), "video_fault": fault and fault_text(fault), "video_fault_at": at}


def _card_context(request: HttpRequest, evaluation: Evaluation, video: Video | None) -> dict:
    run = VideoRun.of(evaluation)
    videos = videos_of(run)
    shown = next((each for each in videos if video is not None and each.video.pk == video.pk), None)
    if shown is None:
        shown = best_shown(videos, page_language(), request.user)
    return _of_card(request, run, videos, shown) | {"evaluation": evaluation}


def _of_card(request: HttpRequest, run: VideoRun, videos: list[ShownVideo], shown: ShownVideo | None) -> dict:
    others = [each for each in videos if each.state == VideoState.READY and each is not shown]
    return {
        "shown": shown,
        "shown_car": run.car(shown.video.car) if shown and len(run.cars) > 1 else None,
        "other_videos": [(each.video, run.car(each.video.car) if len(run.cars) > 1 else None) for each in others],
        "can_stop_video": shown is not None and can_stop_video(request.user, shown.video),
        "can_ask": settings.VIDEOS and request.user.is_authenticated,  # the page has checked that the run is visible
        "video_cars": [(row, best_lap(row.result.laps)) for row in run.cars],
        "preselected": _preselected(request, run, videos, shown),
        "video_cameras": VideoCamera.choices,
        "video_formats": VideoFormat.choices,
        "video_limit_ms": settings.VIDEO_SECONDS * 1000,
    }


def _preselected(
    request: HttpRequest, run: VideoRun, videos: list[ShownVideo], shown: ShownVideo | None
) -> tuple[int, int]:
    """The form's default car and part: a failed or stale video, else the first missing one, the reader's best lap
    first."""
    if shown is not None and shown.state in ("failed", "stale"):
        return shown.video.car, shown.video.part
    row = next((row for row in run.cars if row.racer == request.user), run.cars[0])
    best = best_lap(row.result.laps)
    made = {
        (each.video.car, each.video.part)
        for each in videos
        if each.video.language == page_language() and not each.video.to_ms and each.state not in ("failed", "stale")
    }
    parts = [*([best] if best else []), WHOLE, *(lap["number"] for lap in row.result.laps)]
    return next(((row.number, part) for part in parts if (row.number, part) not in made), (row.number, parts[0]))
