"""A racer's trainings: the list, one of them while it runs and after, and what can be done with it."""

from __future__ import annotations

import json
import zlib
from typing import Any, Literal

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.storage import MEGABYTE
from accounts.who import racer_of
from core.forms import explain
from paddock.errors import PaddockError, UserFault
from races.layout import box_marks
from races.models import Race, RaceType
from races.names import named
from races.replay import map_point, map_size
from races.views.common import tell_fault
from tracks.drawing import BoxMark
from training.endings import how_it_ended
from training.graph import SMOOTHINGS, draw_graph, points_of
from training.models import TrainingIteration, TrainingJob
from training.queue_order import place_of
from training.quotas import bytes_of
from training.selectors import can_delete_training, can_stop_training, trainings_of
from training.services import delete_training, evaluate_training, stop_training, train_first_car
from training.services.remove import models_of

from .common import usage_of, visible_training

PER_PAGE = 30
LOG_SHOWN = 4000
APART = "~"


@login_required
@require_safe
def trainings(request: HttpRequest) -> HttpResponse:
    """My trainings, newest first."""
    page = Paginator(trainings_of(request.user), PER_PAGE).get_page(request.GET.get("page"))
    return render(
        request, "training/trainings.html", {"page": page, "usage": usage_of(racer_of(request), timezone.now())}
    )


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def training_first(request: HttpRequest) -> HttpResponse:
    """Train my first car: one click, no form. Who comes back here from logging in finds the button on the list."""
    if request.method != "POST":
        return redirect("trainings")
    try:
        job = train_first_car(owner=racer_of(request), now=timezone.now())
    except PaddockError as fault:
        tell_fault(request, fault)
        return redirect("trainings")
    if job.submit_to_race is None:
        messages.success(request, _("Training your first car. This page updates itself."))
    else:
        text = _("Training your first car. It is submitted to %(race)s when done.")
        messages.success(request, text % {"race": named(job.submit_to_race.name)})
    return redirect(job)


@login_required
@require_safe
def training(request: HttpRequest, public_id: str) -> HttpResponse:
    """One training: its graph, the car driving, and when it is over what to do with the model."""
    job = visible_training(request, public_id)
    response = render(request, "training/training.html", _context(request, job))
    if not job.is_final:
        response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_safe
def training_live(request: HttpRequest, public_id: str) -> HttpResponse:
    """What of the page has changed. ``seen`` is what the reader has on screen: unchanged, the answer is empty (204);
    without another iteration it is the figures without the graph; over, the page is loaded anew."""
    job = visible_training(request, public_id, whole=False)
    last = _last(job)
    seen, mark = request.GET.get("seen", ""), _mark(request, job, last)
    if seen == mark or job.is_final:
        response = HttpResponse(status=204)  # before anything is drawn: it is asked for all the time
        if seen != mark:
            response["HX-Refresh"] = "true"
    else:
        context = _figures(request, job, last)
        _, graph, prints = _parts(seen)
        context["graph_is_new"] = graph != _parts(mark)[1]
        context["prints_are_new"] = prints != _parts(mark)[2]
        if context["graph_is_new"]:
            context |= _graph(request, job)
        response = render(request, "training/parts/live.html", context)
    response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_POST
def training_stop(request: HttpRequest, public_id: str) -> HttpResponse:
    """Stop a training; what it has learned stays."""
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
    """Ask, and say what it frees; then delete a training of mine that is over."""
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
    return render(request, "training/delete.html", context, status=409 if problem else 200)


@login_required
@require_POST
def training_evaluate(request: HttpRequest, public_id: str) -> HttpResponse:
    """Drive the best or the last model three laps on the track that it was trained on, by the referee of races."""
    job = visible_training(request, public_id)
    if job.owner_id != request.user.pk:
        raise Http404
    which: Literal["best", "last"] = "last" if request.POST.get("model") == "last" else "best"
    try:
        evaluation = evaluate_training(job=job, which=which, by=request.user, now=timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect(job)
    return redirect(evaluation)


def _last(job: TrainingJob) -> TrainingIteration | None:
    return job.iterations.defer("episodes", "eval_trials").order_by("-number").first()


def _mark(request: HttpRequest, job: TrainingJob, last: TrainingIteration | None) -> str:
    """What tells two states of the page apart: its figures, its graph, and the lines that are printed; between them
    :data:`APART`."""
    steps = (job.progress or {}).get("steps", 0)
    figures = (place_of(job, timezone.now()), steps, bool(job.stop_asked_at))
    # the row, not its number: what goes on from a checkpoint drives the same numbers again
    graph = (job.state, last.pk if last else 0, _window(request))
    prints = (zlib.crc32(job.printed.encode()),)
    return APART.join("-".join(map(str, part)) for part in (figures, graph, prints))


def _parts(mark: str) -> list[str]:
    """The three of them; empty where an address says less."""
    return [*mark.split(APART), "", "", ""][:3]


def _window(request: HttpRequest) -> int:
    """How many iterations are smoothed."""
    smoothing = request.GET.get("smooth", "")
    return int(smoothing) if smoothing in map(str, SMOOTHINGS) else 1


def _context(request: HttpRequest, job: TrainingJob) -> dict[str, Any]:
    """The whole page."""
    last = _last(job)
    mine = request.user.pk == job.owner_id
    tracks = job.tracks
    return {
        "tracks": tracks,
        "more_tracks": len(tracks) - 1,
        **_figures(request, job, last),
        **_graph(request, job),
        "can_stop": can_stop_training(request.user, job),
        "can_delete": can_delete_training(request.user, job),
        "is_mine": mine,
        "map_size": map_size(job.track),
        "layout_boxes": _boxes(job),
        "ending": how_it_ended(job, request.user),
        "model": job.best_model if mine else None,
    }


def _figures(request: HttpRequest, job: TrainingJob, last: TrainingIteration | None) -> dict[str, Any]:
    """What changes from second to second; it costs the same however long the training is."""
    progress = job.progress or {}
    seconds = max(job.seconds_done, float(progress.get("seconds", 0)))
    return {
        "job": job,
        "last": last,
        "best": job.iterations.filter(is_best=True).defer("episodes", "eval_trials").first(),
        "steps": max(job.steps_done, int(progress.get("steps", 0))),
        "steps_per_second": progress.get("steps_per_second") or (last.steps_per_second if last else None),
        "seconds": seconds,
        "seconds_left": max(0.0, job.stop_minutes * 60.0 - seconds),
        "position": place_of(job, timezone.now()),
        "sight": _sight(job),
        "smoothing": _window(request),
        "mark": _mark(request, job, last),
    }


def _sight(job: TrainingJob) -> dict[str, Any]:
    """What a car of a training under way sees, its steering as an angle to one side."""
    if job.is_final or not job.seen:
        return {}
    return {**job.seen, "turn": abs(job.seen["steering"]), "is_left": job.seen["steering"] > 0}


def _graph(request: HttpRequest, job: TrainingJob) -> dict[str, Any]:
    """What changes with an iteration."""
    points, drive = points_of(job), _drive(job)
    return {
        "graph": draw_graph(points, _window(request)),
        "smoothings": SMOOTHINGS,
        "iterations": len(points),
        "log": job.log[-LOG_SHOWN:],
        "drive": json.dumps(drive),
        "has_driven": bool(drive),
    }


def _drive(job: TrainingJob) -> list[list[float]]:
    """The newest drive in the coordinates of the map: x, y, heading in radians (clockwise there), speed in m/s."""
    return [[*map_point(job.track, x, y), round(-yaw, 3), round(speed, 2)] for x, y, yaw, speed in (job.driving or [])]


def _boxes(job: TrainingJob) -> tuple[BoxMark, ...]:
    """The boxes of its layout on the map."""
    if job.race_type != RaceType.OBJECT_AVOIDANCE:
        return ()
    names = ("track", "direction", "race_type", "boxes", "random_boxes", "seed")
    return box_marks(Race(**{name: getattr(job, name) for name in names}))
