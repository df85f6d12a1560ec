"""An evaluation: waiting, on track, done; its files."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.http import require_POST, require_safe

from core.pages.live_parts import live_part
from evaluation.garage.downloads import logs_of
from evaluation.models import CompetitorResult, Evaluation, State
from evaluation.running.competitors import CompetitorRow, LiveCompetitor, car_rows, live_cars
from evaluation.running.queue.selectors import expected_wait_s, queue_position
from evaluation.running.queue.services import stop_evaluation
from evaluation.running.results import read_trace
from evaluation.selectors import can_see_model
from races.boards.selectors.results import HeatResult, RunResult, heat_of, result_of
from races.entries.selectors.lists import replaced_by
from races.models import OwnEvaluation
from races.replays.run_maps import ColourBy, lap_rows, map_point, map_size, speed_scale, trajectories
from races.replays.selectors import direction_of
from races.replays.setup import run_setup
from races.rules.layout import awaited_boxes, driven_boxes
from races.runs.video_titles import race_of_marks
from races.telemetry.largest_loss import largest_loss
from races.test_runs.selectors import can_stop_run, own_result

from ...web.names import named
from ...web.views import downloaded, finished_evaluation, shown_evaluation, visible_evaluation
from ..latest_run import live_mark
from .videos import video_context

Car = TypeVar("Car", CompetitorRow, LiveCompetitor)


@require_safe
def evaluation(request: HttpRequest, public_id: str) -> HttpResponse:
    """One evaluation; while it waits or drives, the page renews itself."""
    shown = shown_evaluation(request, public_id)
    response = render(request, "races/runs/page.html", _context(request, shown))
    if not shown.is_final:
        response["Cache-Control"] = "private, no-store"
    return response


@require_safe
def evaluation_live(request: HttpRequest, public_id: str) -> HttpResponse:
    """The part of the page that changes while the car waits or drives; the whole result once it is done."""
    shown = shown_evaluation(request, public_id)
    context = _context(request, shown)
    template, whole = ("evaluation.html", "#evaluation") if shown.is_final else ("live.html", "")
    return live_part(request, context["mark"], f"races/runs/{template}", lambda: context, whole)


@login_required
@require_POST
def evaluation_stop(request: HttpRequest, public_id: str) -> HttpResponse:
    shown = visible_evaluation(request, public_id)
    if not shown.is_final:
        if not can_stop_run(request.user, shown):
            raise Http404
        stop_evaluation(evaluation=shown, now=timezone.now())
    return redirect(shown)


@require_safe
def evaluation_trace(request: HttpRequest, public_id: str) -> HttpResponse:
    """The sim-trace as CSV, as the community's tools read it; with ``car`` that of another car of the run."""
    shown, result, suffix = _finished_car(request, public_id)
    return downloaded(read_trace(result), f"{shown.public_id}{suffix}-sim-trace.csv", "text/csv; charset=utf-8")


@require_safe
def evaluation_metrics(request: HttpRequest, public_id: str) -> HttpResponse:
    """The evaluation metrics JSON, as the community's tools read it; with ``car`` that of another car of the run."""
    shown, result, suffix = _finished_car(request, public_id)
    response = JsonResponse(result.metrics, json_dumps_params={"indent": 1})
    response["Content-Disposition"] = f'attachment; filename="{shown.public_id}{suffix}-metrics.json"'
    return response


@require_safe
def evaluation_logs(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """Traces, metrics and log of all cars of the run in one zip, as the community's tools read it."""
    return logs_of(finished_evaluation(request, public_id), request.user)


def _finished_car(request: HttpRequest, public_id: str) -> tuple[Evaluation, CompetitorResult, str]:
    """A finished run, the result of its car ``car`` (0: the run's own), and that car's part of file names."""
    shown = finished_evaluation(request, public_id)
    number = request.GET.get("car", "0")
    if number == "0":
        return shown, shown.result, ""
    rival = get_object_or_404(shown.result.rivals, number=int(number) if number.isdecimal() else None)
    return shown, rival, f"-car{rival.number}"


def _context(request: HttpRequest, shown: Evaluation) -> dict:
    submission = getattr(shown, "submission", None)
    duel = getattr(shown, "duel", None)
    own: OwnEvaluation | None = getattr(shown, "own", None)
    race = submission.entry.race if submission else duel and duel.race
    if race is not None and race.track_id == shown.track_id:
        race.track = shown.track
    context = {
        "evaluation": shown,
        "submission": submission,
        "duel": duel,
        "race": race,
        "direction": direction_of(shown),
        "own": own,
        "can_stop": can_stop_run(request.user, shown),
        "shows_model": can_see_model(request.user, shown.model),
        "replaced_by": replaced_by(shown) if race is None else None,
        "is_mine": request.user.is_authenticated and request.user.pk == shown.owner_id,
    }
    if shown.state == State.FINISHED:
        rows = car_rows(shown)
        context["heading"] = heading = _heading(rows)
        drivers = " – ".join(each.label for each in heading) or shown.owner.shown_name
        context["share_title"] = f"{drivers} · {shown.track.name if race is None else named(race.name)}"
        colour = ColourBy.of(request.GET.get("colour"))
        lap = request.GET.get("lap", "")
        car = _chosen_car(request, rows)
        number = int(lap) if lap.isdecimal() and 0 < int(lap) <= len(car.result.laps) else None
        context |= {
            "mark": live_mark(shown, None),
            "result": shown.result,
            "car": car,
            "laps": lap_rows(car.result.laps, race_of_marks(shown)),
            "colour": colour,
            "lap": number,
            "lines": trajectories(car.result.trajectory, colour, number),
            "map_key": (shown.pk, shown.result.trace_sha256, car.number, colour, number),
            "speed_scale": speed_scale(car.result.trajectory),
            "boxes": driven_boxes(shown.result.layout),
            "bot_count": shown.spec["rules"].get("bots", 0),
            "cars": rows,
            "may_crash": shown.spec["rules"].get("race_type", "time_trial") != "time_trial" or car.result.crashes,
            "viewer": run_setup(shown, reader=request.user),
            "worth": _worth(request, shown, car),
            "own_worth": own_result(own, shown.result) if own else None,
            "loss": None if car.number else largest_loss(shown),
        }
        return context | video_context(request, shown, rows)
    position = queue_position(shown)
    progress = shown.progress or {}
    cars = live_cars(shown)
    standing = sorted(cars, key=lambda car: car.place_key)
    context |= {
        "heading": _heading(cars),
        "standing": standing if len(cars) > 1 else [],
        "clock_ms": max(car.progress.get("total_ms", 0) for car in cars),
        "mark": live_mark(shown, position),
        "position": position,
        "wait_s": expected_wait_s(shown, position) if position else None,
        "progress": progress,
        "bots": [map_point(shown.track, x, y) for x, y in progress.get("bots", ())],
        "dots": _dots(shown, cars),
        "boxes": awaited_boxes(shown.track, shown.spec["rules"]),
        "map_size": map_size(shown.track),
    }
    return context


def _worth(request: HttpRequest, shown: Evaluation, car: CompetitorRow) -> RunResult | HeatResult | None:
    """The result of a finished run in its race, None for a test drive. Earlier results are for its racer alone."""
    submission, duel = getattr(shown, "submission", None), getattr(shown, "duel", None)
    if submission is not None:
        return result_of(submission, shown.result.laps, with_earlier=request.user.pk == shown.owner_id)
    return None if duel is None else heat_of(duel, car.racer.pk)


def _chosen_car(request: HttpRequest, rows: Sequence[CompetitorRow]) -> CompetitorRow:
    """The car whose laps are shown: that of ``car``, else the reader's own, else the one whose run it is."""
    asked = request.GET.get("car", "")
    wanted = (lambda row: str(row.number) == asked, lambda row: row.racer == request.user, lambda row: not row.number)
    return next(row for fits in wanted for row in rows if fits(row))


def _heading(cars: Sequence[Car]) -> list[Car]:
    """The cars of a run where there are several, in the order of the start; none for a car alone."""
    return sorted(cars, key=lambda car: car.number) if len(cars) > 1 else []


def _dots(shown: Evaluation, cars: Iterable[LiveCompetitor]) -> list[tuple[LiveCompetitor, tuple[float, float]]]:
    """The racers' cars that are on the map just now, and where. The car whose run it is comes last, on top."""
    return [
        (car, map_point(shown.track, car.progress["x"], car.progress["y"]))
        for car in sorted(cars, key=lambda car: -car.number)
        if "x" in car.progress and "y" in car.progress and not car.is_retired
    ]
