"""The list of a racer's trainings, the page of one, and its actions."""

import json
import math
import zlib
from collections.abc import Sequence
from typing import Any, Literal

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.db.models import Q, QuerySet, Subquery
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.request_racer import racer_of
from accounts.usage.storage import MEGABYTE
from core.database.kept_queries import KeptQuery
from core.forms import explain
from core.pages.faults import faults_reported
from core.pages.pager import LeanPaginator
from core.streams.shared_pieces import lasting_value, shared_value
from paddock.errors import UserFault
from paddock.rules.race import BOX_COUNT
from races.models import Race, RaceType
from races.replays.run_maps import map_point, map_size
from races.rules.layout import box_marks
from tracks.drawing.maps import BoxMark
from training.jobs.exports import Download, download
from training.jobs.progress_graph import SMOOTHINGS, draw_graph, points_of
from training.jobs.queue_order import place_of
from training.jobs.selectors import (
    can_delete_training,
    can_see_training,
    can_stop_training,
    closed_because,
    how_it_ended,
    training_quotas,
    trainings_of,
    visible_trainings,
)
from training.jobs.services.deletion import delete_training, models_of
from training.jobs.services.queue import stop_training
from training.jobs.services.results import evaluate_training
from training.models import TrainingIteration, TrainingJob
from training.models.job import TrainingTrack
from training.quotas import bytes_of

PER_PAGE = 30
SWEEPS_LISTED = 20
LOG_SHOWN = 4000
APART = "~"


@login_required
@require_safe
def trainings(request: HttpRequest) -> HttpResponse:
    page = LeanPaginator(trainings_of(request.user), PER_PAGE).get_page(request.GET.get("page"))
    quotas = training_quotas(racer_of(request), timezone.now())
    sweeps = racer_of(request).sweeps.order_by("-created_at")[:SWEEPS_LISTED]
    context = {"page": page, "sweeps": sweeps, "quotas": quotas, "closed": closed_because()}
    return render(request, "training/jobs/list.html", context)


@login_required
@require_safe
def training(request: HttpRequest, public_id: str) -> HttpResponse:
    job = visible_training(request, public_id)
    mine, last = request.user.pk == job.owner_id, _last(job)
    tracks = [job.track, *(one.track for one in _more_tracks(job=job.pk))]
    context = {
        "tracks": tracks,
        "more_tracks": len(tracks) - 1,
        **_figures(request, job, last, place_of(job, timezone.now())),
        **_graph(request, job, last),
        "can_stop": can_stop_training(request.user, job),
        "can_delete": can_delete_training(request.user, job),
        "is_mine": mine,
        "sweep": job.trial.sweep if hasattr(job, "trial") else None,
        "map_size": map_size(job.track),
        "layout_boxes": (boxes := _boxes(job)),
        "drive_scene": json.dumps(_scene(job, boxes)),
        "ending": how_it_ended(job, request.user),
        "model": job.best_model if mine else None,
    }
    response = render(request, "training/jobs/training.html", context)
    if not job.is_final:
        response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_safe
def training_live(request: HttpRequest, public_id: str) -> HttpResponse:
    """What has changed since ``seen``, the mark of the reader's page: nothing (204), the figures, or figures and graph;
    a refresh of the page when the training is over."""
    job = visible_training(request, public_id, whole=False)
    last = _last(job)
    place = place_of(job, timezone.now())
    seen, mark = request.GET.get("seen", ""), _mark(request, job, last, place)
    if seen == mark or job.is_final:
        response = HttpResponse(status=204)  # before any rendering: pages poll this often
        if seen != mark:
            response["HX-Refresh"] = "true"
    else:
        context = _figures(request, job, last, place)
        _, graph, prints = _parts(seen)
        context["graph_is_new"] = graph != _parts(mark)[1]
        context["prints_are_new"] = prints != _parts(mark)[2]
        if context["graph_is_new"]:
            context |= _graph(request, visible_training(request, public_id), last)  # with the log and the drive
        response = render(request, "training/jobs/parts/live.html", context)
    response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_POST
def training_stop(request: HttpRequest, public_id: str) -> HttpResponse:
    job = visible_training(request, public_id)
    if not job.is_final:
        if not can_stop_training(request.user, job):
            raise Http404
        stop_training(job=job, by=racer_of(request), now=timezone.now())
        if job.is_final:
            messages.success(request, _("Training stopped before it started."))
        else:
            messages.success(request, _("Stopping. Best and last model are kept."))
    return redirect(job)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def training_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    job = visible_training(request, public_id)
    if not can_delete_training(request.user, job):
        raise Http404
    problem = None
    if request.method == "POST":
        try:
            freed = delete_training(job=job, with_models="models" in request.POST, now=timezone.now())
        except UserFault as fault:
            problem = explain(fault)
        else:
            messages.success(request, _("Training deleted: %(mb).1f MB freed.") % {"mb": freed / MEGABYTE})
            return redirect("trainings")
    context = {"job": job, "mb": bytes_of(job) / MEGABYTE, "models": models_of(job), "problem": problem}
    return render(request, "training/jobs/delete.html", context, status=409 if problem else 200)


@login_required
@require_POST
def training_evaluate(request: HttpRequest, public_id: str) -> HttpResponse:
    job = visible_training(request, public_id)
    if job.owner_id != request.user.pk:
        raise Http404
    which: Literal["best", "last"] = "last" if request.POST.get("model") == "last" else "best"
    with faults_reported(request):
        return redirect(evaluate_training(job=job, which=which, by=request.user, now=timezone.now()))
    return redirect(job)


def _last(job: TrainingJob) -> TrainingIteration | None:
    """The newest iteration. The training keeps the best one beside it, see :func:`_best`: one query for both."""
    shown = _shown_iterations(job=job.pk)
    job._best = next((row for row in shown if row.is_best), None)
    return shown[-1] if shown else None


def _best_and_last(job: Any) -> QuerySet[TrainingIteration]:
    iterations = TrainingIteration.objects.filter(job_id=job)
    numbers = iterations.order_by("-number").values("number")[:1]
    rows = iterations.filter(Q(is_best=True) | Q(number=Subquery(numbers))).defer("episodes", "eval_trials")
    return rows.order_by("number")


_shown_iterations = KeptQuery(_best_and_last)


_more_tracks = KeptQuery(
    lambda job: TrainingTrack.objects.filter(job_id=job).select_related("track").defer("track__npy").order_by("place")
)


def _best(job: TrainingJob, last: TrainingIteration | None) -> TrainingIteration | None:
    return last if last is None or last.is_best else job._best


def _mark(request: HttpRequest, job: TrainingJob, last: TrainingIteration | None, place: int | None) -> str:
    """A mark that changes with the page: for figures, graph and printed lines, separated by :data:`APART`."""
    steps = (job.progress or {}).get("steps", 0)
    figures = (place, steps, bool(job.stop_asked_at))
    # the row, not its number: what goes on from a checkpoint drives the same numbers again
    graph = (job.state, last.pk if last else 0, _window(request))
    prints = (zlib.crc32(job.printed.encode()),)
    return APART.join("-".join(map(str, part)) for part in (figures, graph, prints))


def _parts(mark: str) -> list[str]:
    return [*mark.split(APART), "", "", ""][:3]


def _window(request: HttpRequest) -> int:
    smoothing = request.GET.get("smooth", "")
    return int(smoothing) if smoothing in map(str, SMOOTHINGS) else 1


def _figures(
    request: HttpRequest, job: TrainingJob, last: TrainingIteration | None, place: int | None
) -> dict[str, object]:
    """What changes from second to second; it costs the same however long the training is."""
    progress = job.progress or {}
    seconds = max(job.seconds_done, float(progress.get("seconds", 0)))
    return {
        "job": job,
        "last": last,
        "best": _best(job, last),
        "steps": max(job.steps_done, int(progress.get("steps", 0))),
        "steps_per_second": progress.get("steps_per_second") or (last.steps_per_second if last else None),
        "seconds": seconds,
        "seconds_left": max(0.0, job.limit_s - seconds),
        "position": place,
        "sight": {} if job.is_final or not job.seen else job.seen | {"turn": abs(job.seen["steering"])},
        "smoothing": _window(request),
        "mark": _mark(request, job, last, place),
    }


def _graph(request: HttpRequest, job: TrainingJob, last: TrainingIteration | None) -> dict[str, object]:
    window, drive = _window(request), _drive(job)

    def drawn() -> tuple[Any, int]:
        points = points_of(job, last)
        return draw_graph(points, window), len(points)

    # an iteration does not change, so the newest one stands for all
    shared = lasting_value if job.is_final else shared_value
    graph, iterations = shared(("graph of a training", job.public_id, last and last.pk, window), drawn)
    return {
        "graph": graph,
        "smoothings": SMOOTHINGS,
        "iterations": iterations,
        "log": job.log[-LOG_SHOWN:],
        "drive": json.dumps(drive),
        "has_driven": bool(drive),
    }


def _drive(job: TrainingJob) -> list[list[float]]:
    """The newest drive on the map: x, y, heading in radians (clockwise there), speed in m/s."""
    return [[*map_point(job.track, x, y), round(-yaw, 3), round(speed, 2)] for x, y, yaw, speed in (job.driving or [])]


def _scene(job: TrainingJob, boxes: Sequence[BoxMark]) -> dict[str, object]:
    """What the viewer needs beside the newest drive: the scene document, the car's look, the boxes."""
    return {
        "scene": f"{reverse('track_scene', args=[job.track.slug])}?direction={job.direction}",
        "look": {"shell": job.shell, "colour": job.colour},
        "name": job.name,
        "boxes": [{"x": box.x, "y": box.y, "yaw": round(math.degrees(box.yaw), 1)} for box in boxes],
    }


def _boxes(job: TrainingJob) -> tuple[BoxMark, ...]:
    if job.race_type != RaceType.OBJECT_AVOIDANCE:
        return ()
    names = ("track", "direction", "race_type", "boxes", BOX_COUNT, "seed")
    return box_marks(Race(**{name: getattr(job, name) for name in names}))


def visible_training(request: HttpRequest, public_id: str, *, whole: bool = True) -> TrainingJob:
    """The training, or 404. ``whole=False``: only the columns that polling needs; the others load on access."""
    if whole:
        job = next(iter(_whole(public_id=public_id)), None)
        if job is None or not can_see_training(request.user, job):
            raise Http404
        return job
    jobs = visible_trainings(request.user).defer("log", "driving", "reward_code", "operator_detail")
    return get_object_or_404(jobs, public_id=public_id)


_RELATED = (
    *("track", "owner", "best_model__network", "last_model__network", "cloned_from", "submit_to_race"),
    *("trial__sweep", "own_evaluation__evaluation__track"),
)
_whole = KeptQuery(lambda public_id: TrainingJob.objects.filter(public_id=public_id).select_related(*_RELATED))


@login_required
@require_safe
def training_file(request: HttpRequest, public_id: str, file: Download) -> HttpResponseBase:
    response = download(visible_training(request, public_id), file, racer_of(request))
    if response is None:
        raise Http404
    return response
