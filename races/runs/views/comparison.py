"""Two runs beside each other: which, and one lap of each against the other."""

from typing import Any
from urllib.parse import urlencode

from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.template.loader import render_to_string
from django.urls import reverse
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from core import times
from core.streams.shared_pieces import shared_piece
from evaluation.appearance.looks import distinguish_looks
from evaluation.models import Evaluation, State
from evaluation.running.results import read_trace
from paddock.errors import UserFault
from races.boards.selectors.results import place_of
from races.models import Entry, Submission
from races.replays.comparison import LapComparison, best_lap, compare, ghost_data, lap_line
from races.replays.run_maps import lap_rows, map_size, replay_data
from races.replays.selectors import direction_of, offers_to_compare, race_of, refuse_incomparable
from races.rules.layout import driven_boxes
from races.runs.comparison_charts import gap_chart, speed_chart
from tracks.drawing import Trajectory

from ...web.views import finished_evaluation, public_evaluation, report_fault, shown_evaluation, visible_evaluation

AHEAD = "ahead"


@require_safe
def evaluation_compare(request: HttpRequest, public_id: str) -> HttpResponse:
    """The runs to compare with; ``with``: a link or id that the page redirects to, or ``ahead``: the next car on the
    board."""
    shown = finished_evaluation(request, public_id)
    asked = request.GET.get("with", "").strip()
    if asked == AHEAD:
        asked = _ahead(shown)
    if asked:
        other_id = asked.partition("/evaluations/")[2].partition("/")[0] or asked
        try:
            other = visible_evaluation(request, other_id[:64])
            refuse_incomparable(shown, other)
        except Http404:
            report_fault(request, UserFault("compare_unknown"))
        except UserFault as fault:
            report_fault(request, fault)
        else:
            return redirect("evaluation_compared", public_id, other.public_id)
        return redirect("evaluation_compare", public_id)
    context = {"evaluation": shown, "offers": offers_to_compare(shown, request.user, race_of(shown))}
    return render(request, "races/runs/compare.html", context)


@require_safe
def evaluation_compared(request: HttpRequest, public_id: str, other_id: str) -> HttpResponse:
    """A lap of a run against a lap of another; ``lap`` and ``other_lap``: which, the best of each unless they do. Two
    public runs are compared once for all readers."""
    public = public_evaluation(public_id), public_evaluation(other_id)
    template = "races/runs/parts/comparison.html"
    try:
        shown, other, numbers = _chosen(request, public_id, other_id)

        def values() -> dict[str, Any]:
            return _comparison(shown, other, numbers)

        if all(public):
            drawn = shared_piece(template, values, key=(public_id, other_id, numbers))
        else:
            drawn = render_to_string(template, values())
    except UserFault as fault:
        report_fault(request, fault)
        return redirect("evaluation_compare", public_id)
    context = {"names": _names(shown, other), "track": shown.track, "comparison": drawn}
    return render(request, "races/runs/compared.html", context)


def _comparison(shown: Evaluation, other: Evaluation, numbers: tuple[int, int]) -> dict[str, Any]:
    """The context of the comparison. Raises UserFault."""
    runs, names, compared = [shown, other], _names(shown, other), _compared(shown, other, numbers)
    looks = distinguish_looks([run.model.look for run in runs])
    lines = [_line(run, number, f"lap-{index}") for index, (run, number) in enumerate(zip(runs, numbers, strict=True))]
    query = urlencode({"lap": numbers[0], "other_lap": numbers[1]})
    return {
        "evaluation": shown,
        "other": other,
        "names": names,
        "cars": [
            {"number": index, "look": look, "name": name, "run": run, "lap": number}
            for index, (look, name, run, number) in enumerate(zip(looks, names, runs, numbers, strict=True))
        ],
        "compared": compared,
        "direction": direction_of(shown),
        "lines": [line for line in lines if line],
        "boxes": driven_boxes(shown.result.layout),
        "map_size": map_size(shown.track),
        "replay": reverse("evaluation_compared_replay", args=[shown.public_id, other.public_id]) + f"?{query}",
        "rows": _rows(shown, other, numbers),
        "sentence": _sentence(compared, names),
        "gained": compared.stretch(gained=True),
        "lost": compared.stretch(gained=False),
        "gap_chart": gap_chart(
            compared, title=_sentence(compared, names), ahead=_("%s ahead") % names[0], behind=_("%s ahead") % names[1]
        ),
        "speed_chart": speed_chart(compared, title=_("Speed of both along the lap")),
    }


@require_safe
def evaluation_compared_replay(request: HttpRequest, public_id: str, other_id: str) -> HttpResponse:
    """Every step of both laps, in the coordinates of the map; both clocks begin with the lap."""
    try:
        shown, other, numbers = _chosen(request, public_id, other_id)
        _compared(shown, other, numbers)
    except UserFault as fault:
        raise Http404 from fault
    one, ghost = (
        ghost_data(replay_data(shown.track, read_trace(run.result)), run.result.laps, number)
        for run, number in zip((shown, other), numbers, strict=True)
    )
    response = JsonResponse({**one, "bots": [], "rivals": [{"number": 1, **ghost}], "before": numbers[0] - 1})
    response["Cache-Control"] = "private, max-age=0, must-revalidate"
    return response


def _ahead(shown: Evaluation) -> str:
    """The id of the counted run of the car ahead, else of the leader, else of a house car; empty without any."""
    submission = getattr(shown, "submission", None)
    if submission is None:
        return ""
    place = place_of(submission.entry)
    rival = place.ahead or place.leader
    best = rival.entry.best if rival else _house_car_ahead(submission.entry)
    return best.evaluation.public_id if best else ""


def _house_car_ahead(entry: Entry) -> Submission | None:
    house = Entry.objects.filter(race=entry.race_id, is_baseline=True, best__isnull=False).exclude(pk=entry.pk)
    house = house.select_related("best__evaluation").order_by("rank_score", "rank_lap", "pk")
    found = house.filter(rank_score__lt=entry.rank_score).last() or house.first()
    return found.best if found else None


def _chosen(request: HttpRequest, public_id: str, other_id: str) -> tuple[Evaluation, Evaluation, tuple[int, int]]:
    """Both runs, and the numbers of the laps. Raises Http404, UserFault."""
    shown, other = shown_evaluation(request, public_id), shown_evaluation(request, other_id)
    if shown.state != State.FINISHED:
        raise Http404
    refuse_incomparable(shown, other)
    return shown, other, (_lap(request, "lap", shown), _lap(request, "other_lap", other))


def _compared(shown: Evaluation, other: Evaluation, numbers: tuple[int, int]) -> LapComparison:
    """Raises UserFault for a lap that cannot be compared."""
    one, ghost = (
        lap_line(read_trace(run.result), run.result.laps, number)
        for run, number in zip((shown, other), numbers, strict=True)
    )
    return compare(one, ghost, shown.track.geometry.length)


def _names(shown: Evaluation, other: Evaluation) -> list[str]:
    """The names of both: of their racers, for one racer of their models."""
    runs = (shown, other)
    names = [run.owner.alias for run in runs]
    if names[0] == names[1]:
        names = [run.model.name for run in runs]
    return names if names[0] != names[1] else [f"{name} ({number})" for number, name in enumerate(names, 1)]


def _lap(request: HttpRequest, name: str, run: Evaluation) -> int:
    asked = request.GET.get(name, "")
    return int(asked) if asked.isdecimal() and len(asked) < 4 else best_lap(run.result.laps)


def _line(run: Evaluation, lap: int, style: str) -> Trajectory | None:
    driven = run.result.trajectory
    return Trajectory(driven[lap - 1], style=style) if lap <= len(driven) else None


def _rows(shown: Evaluation, other: Evaluation, numbers: tuple[int, int]) -> list[dict]:
    """The laps of both side by side, up to the longer run's."""
    left, right = ({row.lap["number"]: row for row in lap_rows(run.result.laps, None)} for run in (shown, other))
    rows = []
    for number in range(1, max([0, *left, *right]) + 1):
        pair = (left.get(number), right.get(number))
        ours, theirs = (row.lap["time_ms"] if row and row.lap["complete"] else None for row in pair)
        gap = None if ours is None or theirs is None else theirs - ours
        shows = (number == numbers[0], number == numbers[1])
        rows.append({"number": number, "pair": list(zip(pair, shows, strict=True)), "gap_ms": gap})
    return rows


def _sentence(compared: LapComparison, names: list[str]) -> str:
    gap = compared.last_gap_ms
    where = _("at the line") if compared.is_whole else _("after %s m") % f"{compared.metres[-1]:.1f}"
    if not gap:
        return _("Both are as fast %(where)s.") % {"where": where}
    ahead, by = names[0] if gap > 0 else names[1], times.gap(abs(gap)).lstrip("+")
    return _("%(ahead)s is %(gap)s s ahead %(where)s.") % {"ahead": ahead, "gap": by, "where": where}
