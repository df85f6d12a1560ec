"""A racer's trainings: the list, one of them while it runs and after, and what can be done with it."""

from __future__ import annotations

import json
from typing import Any

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from evaluation.selectors import can_use_model
from evaluation.services import queue_evaluation
from evaluation.simulator.rules import RaceRules
from faults import UserFault
from races.course import box_marks
from races.models import Race, RaceType
from races.replay import map_point, map_size
from races.views.common import tell_fault
from tracks.drawing import BoxMark
from training.endings import how_it_ended
from training.graph import SMOOTHINGS, draw_graph, points_of
from training.models import JobState, TrainingJob
from training.selectors import can_stop_training, training_queue_position, trainings_of
from training.services import stop_training
from training.services.create import course_of

from .common import usage_of, visible_training

PER_PAGE = 30
LOG_SHOWN = 4000
LAPS_OF_A_TEST = 3


@login_required
@require_safe
def trainings(request: HttpRequest) -> HttpResponse:
    """My trainings, newest first."""
    page = Paginator(trainings_of(request.user), PER_PAGE).get_page(request.GET.get("page"))
    return render(request, "training/trainings.html", {"page": page, "usage": usage_of(request.user, timezone.now())})


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
    """The part of the page that changes. ``seen`` is what the reader has on screen: unchanged, the answer is empty
    (204); over, the page is loaded anew."""
    job = visible_training(request, public_id)
    if job.is_final:
        response = HttpResponse(status=204)
        if request.GET.get("seen") != _mark(request, job):
            response["HX-Refresh"] = "true"
    elif request.GET.get("seen") == _mark(request, job):
        response = HttpResponse(status=204)  # before anything is drawn: it is asked for all the time
    else:
        response = render(request, "training/parts/live.html", {**_context(request, job), "renewed": True})
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
        stop_training(job=job, by=request.user, now=timezone.now())
        if job.is_final:
            messages.success(request, _("The training is stopped before it began."))
        else:
            messages.success(request, _("It stops now and keeps what it has learned."))
    return redirect(job)


@login_required
@require_POST
def training_evaluate(request: HttpRequest, public_id: str) -> HttpResponse:
    """Drive the best or the last model three laps on the track that it was trained on, by the referee of races."""
    job = visible_training(request, public_id)
    model = job.last_model if request.POST.get("model") == "last" else job.best_model
    if model is None or not can_use_model(request.user, model):
        raise Http404
    rules = RaceRules.from_dict(
        {**course_of(job), "race_type": job.race_type, "direction": job.direction, "laps": LAPS_OF_A_TEST}
        | ({"seed": job.seed} if job.random_boxes or job.bots else {})
    )
    try:
        evaluation = queue_evaluation(owner=request.user, model=model, track=job.track, rules=rules, now=timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect(job)
    return redirect(evaluation)


def _mark(request: HttpRequest, job: TrainingJob) -> str:
    """What tells two states of the page apart."""
    steps = (job.progress or {}).get("steps", 0)
    known = (job.state, training_queue_position(job), job.iterations.count(), steps, bool(job.stop_asked_at))
    return "-".join(map(str, (*known, _window(request))))


def _window(request: HttpRequest) -> int:
    """How many iterations are smoothed."""
    smoothing = request.GET.get("smooth", "")
    return int(smoothing) if smoothing in map(str, SMOOTHINGS) else 1


def _context(request: HttpRequest, job: TrainingJob) -> dict[str, Any]:
    window = _window(request)
    small = job.iterations.defer("simtrace", "eval_trials")
    points = points_of(list(small))
    last = job.iterations.defer("episodes", "eval_trials").order_by("-number").first()
    best = job.iterations.filter(is_best=True).defer("episodes", "eval_trials").first()
    progress = job.progress or {}
    seconds = max(job.seconds_done, float(progress.get("seconds", 0)))
    position = training_queue_position(job)
    mine = request.user.pk == job.owner_id
    return {
        "job": job,
        "graph": draw_graph(points, window),
        "smoothing": window,
        "smoothings": SMOOTHINGS,
        "iterations": len(points),
        "last": last,
        "best": best,
        "steps": max(job.steps_done, int(progress.get("steps", 0))),
        "steps_per_second": progress.get("steps_per_second") or (last.steps_per_second if last else None),
        "seconds": seconds,
        "seconds_left": max(0.0, job.stop_minutes * 60.0 - seconds),
        "percent_of_time": min(100, round(100 * seconds / (job.stop_minutes * 60.0))),
        "position": position,
        "log": job.log[-LOG_SHOWN:],
        "can_stop": can_stop_training(request.user, job),
        "is_mine": mine,
        "drive": json.dumps(_drive(job)),
        "map_size": map_size(job.track),
        "course_boxes": _boxes(job),
        "mark": _mark(request, job),
        "ending": how_it_ended(job, request.user),
        "model": job.best_model if mine else None,
        "is_failed": job.state == JobState.FAILED,
    }


def _drive(job: TrainingJob) -> list[list[float]]:
    """The newest drive in the coordinates of the map: x, y, heading in radians (clockwise there), speed in m/s."""
    return [[*map_point(job.track, x, y), round(-yaw, 3), round(speed, 2)] for x, y, yaw, speed in (job.driving or [])]


def _boxes(job: TrainingJob) -> tuple[BoxMark, ...]:
    """The boxes of its course on the map."""
    if job.race_type != RaceType.OBJECT_AVOIDANCE:
        return ()
    names = ("track", "direction", "race_type", "boxes", "random_boxes", "seed")
    return box_marks(Race(**{name: getattr(job, name) for name in names}))
