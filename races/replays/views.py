"""The page of the viewer, and the documents that it plays."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from django.http import Http404, HttpRequest, HttpResponse, QueryDict
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils.html import escape
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from core import times
from core.pages.faults import report_fault
from core.streams.shared_pieces import filled, hole, lasting_piece
from evaluation.appearance.looks import VehicleLook, distinguish_looks
from evaluation.models import Evaluation, State
from evaluation.running.competitors import car_rows
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.geometry.track import CCW, DIRECTIONS
from races.replays.comparison import LapComparison, LapLine, best_lap, compare, driven_trace, lap_line
from races.replays.document import SCENE_FORMAT, document_key, look_document, run_document, scene_document
from races.replays.reference import viewed_reference
from races.replays.responses import Make, document_response, documents_response
from races.replays.run_maps import LAP_COLOURS, LapRow, lap_rows
from races.replays.selectors import (
    RunOffer,
    Why,
    direction_of,
    named_runs,
    offers_to_compare,
    race_of,
    refuse_incomparable,
)
from races.replays.setup import clip_address, document_address, scene_address, viewer_setup
from races.rules.layout import driven_boxes
from races.spoilers.selectors import spoilers_of
from races.web.views import MOST_RUNS, finished_evaluation, shown_evaluation, visible_evaluations
from tracks.drawing.maps import Trajectory
from tracks.models import ReferenceLap, Track
from tracks.reference.selectors import reference_lap

REFERENCE = "reference"  # for ghost: the reference lap
PART = "part"  # for analysis
WHOLE = 0  # for a lap: the run from its start
_WORDS = frozenset(why.value for why in Why)


@dataclass(frozen=True)
class ReplayedRun:
    """A run on the page: its number in the order asked for, the lap that is shown (:data:`WHOLE`: all), its name and
    look there, and the address of the page without it."""

    number: int
    run: Evaluation
    lap: int
    name: str
    look: VehicleLook
    without: str

    def __str__(self) -> str:
        return self.name

    @property
    def spelled(self) -> str:
        """The run and its lap as ``with`` has them."""
        return _spelled([(self.run.public_id, str(self.lap or ""))])

    @property
    def line(self) -> Trajectory | None:
        """The line of its lap."""
        driven = self.run.result.trajectory
        return (
            Trajectory(driven[self.lap - 1], style=f"lap-{self.number % LAP_COLOURS}")
            if 0 < self.lap <= len(driven)
            else None
        )


@dataclass(frozen=True)
class RunVerdict:
    """The first run against another: which is ahead at the end, and where the first gains and loses most."""

    name: str
    sentence: str
    gained: tuple[float, float, int]
    lost: tuple[float, float, int]


@require_safe
def replay(request: HttpRequest, public_id: str) -> HttpResponse:
    """A run in the viewer. ``with``: up to seven others, each an id, an id and its lap (``id:2``), a link, or one of
    :class:`Why`; ``lap``: of the run, ``all`` for its whole; ``ghost``: :data:`REFERENCE`; ``analysis``: with sentences
    and telemetry, :data:`PART` for these alone, which the page asks for when they come into sight. Scripts read ``t``
    and ``camera``."""
    shown = shown_evaluation(request, public_id)
    if shown.state != State.FINISHED:
        raise Http404
    asked = _asked(request, shown)
    others, refused = _others(request, shown, list(asked))
    beside = [(run.public_id, asked[run.public_id]) for run in others]
    if refused is not None:
        report_fault(request, refused)
    if refused is not None or _spelled(beside) != ",".join(request.GET.getlist("with")):
        return redirect(_address(public_id, request.GET, {"with": _spelled(beside)}))
    cars = car_rows(shown)
    reference = reference_lap(shown.track, direction_of(shown), shown.result.engine)
    with_reference = reference is not None and request.GET.get("ghost") == REFERENCE
    runs = _replayed(shown, request.GET.get("lap", ""), others, beside, alone=not others and not with_reference)
    analysis = request.GET.get("analysis", "")
    if analysis == PART:
        return render(request, "races/replays/analysis.html", {"runs": runs, "verdicts": _verdicts(runs)})
    together = _together(runs)
    context = {
        "evaluation": shown,
        "race": race_of(shown),
        "runs": runs,
        "cars": sorted(cars, key=lambda car: car.number) if len(cars) > 1 else [],
        "direction": direction_of(shown),
        "lines": [line for each in runs if (line := each.line)],
        "map_key": tuple((each.run.result.trace_sha256, each.lap) for each in runs),
        "boxes": driven_boxes(shown.result.layout),
        "viewer": _setup(
            shown, runs, reference if with_reference else None, together, clip_address(shown, request.user)
        ),
        "together": together,
        "reference": reference,
        "reference_toggle": _address(public_id, request.GET, {"ghost": "" if with_reference else REFERENCE}),
        "with_reference": with_reference,
        "has_analysis": bool(analysis),
        "verdicts": _verdicts(runs) if analysis else [],
        "analysis_page": _address(public_id, request.GET, {"analysis": "1", "t": "", "camera": ""}),
        "analysis_part": _address(public_id, request.GET, {"analysis": PART, "t": "", "camera": ""}),
        "rows": _rows(runs) if len(runs) > 1 else [],
        "swapped": _swapped(runs) if len(runs) == 2 else "",
        "offers": _offers(request, shown, runs, beside) if len(runs) < MOST_RUNS else [],
    }
    return render(request, "races/replays/replay.html", context)


@require_safe
def compare_before(request: HttpRequest, public_id: str, other_id: str = "") -> HttpResponse:
    """The address of the page of two runs in earlier versions: redirects to the viewer."""
    laps = [request.GET.get(name, "") for name in ("lap", "other_lap")]
    beside = _spelled([(other_id, laps[1])]) if other_id else request.GET.get("with", "")
    address = _address(public_id, QueryDict(), {"lap": laps[0], "with": beside})
    return redirect(address if "?" in address else f"{address}#offers", permanent=True)


@require_safe
def evaluation_replay(request: HttpRequest, public_id: str) -> HttpResponse:
    """The run document (:mod:`races.replays.document`). ``with``: the ids of others, for one answer with the scene and
    the documents by their addresses, without those that the reader may not see."""
    if "with" not in request.GET:
        return document_response(request, *_run_part(finished_evaluation(request, public_id)))
    wanted = [public_id, *request.GET["with"].split(",")][:MOST_RUNS]
    known = visible_evaluations(request, wanted)
    runs = [known[each] for each in wanted if each in known and known[each].state == State.FINISHED]
    if not runs or runs[0].public_id != public_id:
        raise Http404
    parts = {scene_address(runs[0]): _scene_part(runs[0].track, direction_of(runs[0]))}
    return documents_response(request, parts | {document_address(run): _run_part(run) for run in runs})


@require_safe
def track_scene(request: HttpRequest, slug: str) -> HttpResponse:
    """The scene document (:func:`races.replays.document.scene_document`); ``direction``: ``ccw`` or ``cw``."""
    track = get_object_or_404(Track, slug=slug, length_m__isnull=False)
    direction = request.GET.get("direction", CCW)
    if direction not in DIRECTIONS:
        raise Http404
    return document_response(request, *_scene_part(track, direction))


def _run_part(run: Evaluation) -> tuple[Hashable, Make]:
    cars = car_rows(run)
    return document_key(run, cars), lambda: run_document(run, cars)


def _scene_part(track: Track, direction: str) -> tuple[Hashable, Make]:
    key = "scene document", SCENE_FORMAT, track.slug, track.name, track.geometry.fingerprint, direction
    return key, lambda: scene_document(track, direction)


def _asked(request: HttpRequest, shown: Evaluation) -> dict[str, str]:
    """The ids of ``with`` with their laps, each once; words are replaced by the run that they name. What is beyond
    :data:`MOST_RUNS` is left out before anything is looked up."""
    parts = ",".join(request.GET.getlist("with")).split(",")
    texts = list(dict.fromkeys(text for part in parts if (text := _public_id(part))))[: MOST_RUNS - 1]
    words = {text.partition(":")[0] for text in texts} & _WORDS
    named = named_runs(words, shown, request.user, spoilers_of(request).hidden)
    found: dict[str, str] = {}
    for text in texts:
        run, _colon, lap = text.partition(":")
        if run := named.get(run, "") if run in words else run:
            found.setdefault(run[:64], lap if lap.isdecimal() and len(lap) < 4 else "")
    return found


def _public_id(text: str) -> str:
    """An id, with its lap perhaps, from itself or from a link to the run."""
    return (text.partition("/evaluations/")[2].partition("/")[0] if "/evaluations/" in text else text).strip()


def _others(
    request: HttpRequest, shown: Evaluation, wanted: Sequence[str]
) -> tuple[list[Evaluation], PaddockError | None]:
    """The other runs, and the first refusal among them."""
    known = visible_evaluations(request, wanted)
    others: list[Evaluation] = []
    refused: PaddockError | None = None
    for public_id in wanted:
        try:
            if public_id not in known:
                raise UserFault("compare_unknown")
            refuse_incomparable(shown, known[public_id])
        except UserFault as fault:
            refused = refused or fault
        else:
            others.append(known[public_id])
    return others, refused


def _replayed(
    shown: Evaluation, lap: str, others: Sequence[Evaluation], beside: Sequence[tuple[str, str]], *, alone: bool
) -> list[ReplayedRun]:
    """The runs with their laps: alone the whole run, beside others the best, unless the address names one."""
    runs = [shown, *others]
    if lap == "all" or (not lap and alone):
        laps = [WHOLE] * len(runs)
    else:
        asked = (lap, *(each for _id, each in beside))
        laps = [_lap_of(run, each) for run, each in zip(runs, asked, strict=True)]
    looks = distinguish_looks([run.model.look for run in runs])
    without = [_with(shown, lap, [pair for pair in beside if pair[0] != run.public_id]) for run in runs]
    parts = zip(runs, laps, _names(runs), looks, without, strict=True)
    return [ReplayedRun(number, *each) for number, each in enumerate(parts)]


def _lap_of(run: Evaluation, asked: str) -> int:
    numbers = [lap["number"] for lap in run.result.laps]
    return int(asked) if asked.isdecimal() and len(asked) < 4 and int(asked) in numbers else best_lap(run.result.laps)


def _names(runs: Sequence[Evaluation]) -> list[str]:
    """The racers of the runs, with their models where one has several, and a number where that is not enough."""
    names = [run.owner.shown_name for run in runs]
    names = [
        f"{name} · {run.model.name}" if names.count(name) > 1 else name for run, name in zip(runs, names, strict=True)
    ]
    return [f"{name} ({at})" if names.count(name) > 1 else name for at, name in enumerate(names, 1)]


def _spelled(beside: Sequence[tuple[str, str]]) -> str:
    """Other runs and their laps as ``with`` has them."""
    return ",".join(f"{run}:{lap}" if lap else run for run, lap in beside)


def _with(shown: Evaluation, lap: str, beside: Sequence[tuple[str, str]]) -> str:
    """The page's address with these other runs and their laps."""
    return _spelled_address(shown.public_id, {"lap": lap, "with": _spelled(beside)})


def _address(public_id: str, query: QueryDict, changes: dict[str, str]) -> str:
    """The page's address with a query after these changes, without its empty values."""
    return _spelled_address(public_id, {**dict(query.lists()), **changes})


def _spelled_address(public_id: str, query: Mapping[str, str | Sequence[str]]) -> str:
    """The page's address with what is not empty in the query."""
    address = reverse("replay", args=[public_id])
    spelled = urlencode({name: value for name, value in query.items() if any(value)}, doseq=True, safe=":,")
    return f"{address}?{spelled}" if spelled else address


def _swapped(runs: Sequence[ReplayedRun]) -> str:
    first, other = runs
    return _with(other.run, str(other.lap or "all"), [(first.run.public_id, str(first.lap or ""))])


def _together(runs: Sequence[ReplayedRun]) -> str:
    """The address of the documents of all runs and the scene."""
    first, *others = runs
    beside = ",".join(each.run.public_id for each in others)
    return f"{document_address(first.run)}?with={beside}"


def _setup(
    shown: Evaluation, runs: Sequence[ReplayedRun], reference: ReferenceLap | None, together: str, clip: str
) -> str:
    viewed: Any = [
        {
            "url": document_address(each.run),
            "lap": each.lap,
            **({"name": each.name, "look": look_document(each.look)} if len(runs) > 1 else {}),
        }
        for each in runs
    ]
    if reference is not None:
        viewed.append(viewed_reference(reference))
    page = reverse("replay", args=[shown.public_id])
    return viewer_setup(scene_address(shown), viewed, together=together, page=page, clip=clip)


def _verdicts(runs: Sequence[ReplayedRun]) -> list[RunVerdict]:
    """The first run's lap against that of each other; none where a trace cannot be read or a lap not be compared."""
    lines: list[LapLine | None] = []
    for each in runs if len(runs) > 1 else ():
        try:
            lines.append(_line_of(each.run, each.lap or best_lap(each.run.result.laps)))
        except (UserFault, PlatformFault):
            lines.append(None)
    found = []
    for each, line in zip(runs[1:], lines[1:], strict=True):
        if lines[0] is not None and line is not None:
            compared = compare(lines[0], line, runs[0].run.track.geometry.length)
            stretches = compared.stretch(gained=True), compared.stretch(gained=False)
            found.append(RunVerdict(each.name, _sentence(compared, runs[0].name, each.name), *stretches))
    return found


def _line_of(run: Evaluation, lap: int) -> LapLine:
    """A lap of a run by distance. Raises UserFault ``compare_lap``, PlatformFault ``storage_failed``,
    ``file_damaged``."""
    return lap_line(driven_trace(run.result), run.result.laps, lap)


def _sentence(compared: LapComparison, name: str, other: str) -> str:
    gap = compared.last_gap_ms
    where = _("at the line") if compared.is_whole else _("after %s m") % f"{compared.metres[-1]:.1f}"
    if not gap:
        return _("%(first)s and %(second)s are equally fast %(where)s.") % {
            "first": name,
            "second": other,
            "where": where,
        }
    first, second = (name, other) if gap > 0 else (other, name)
    by = times.gap(abs(gap)).lstrip("+")
    return _("%(first)s is %(gap)s s ahead of %(second)s %(where)s.") % {
        "first": first,
        "second": second,
        "gap": by,
        "where": where,
    }


def _rows(runs: Sequence[ReplayedRun]) -> list[SafeString]:
    """The laps of all runs, lap by lap, with the gap to the same lap of the first."""
    laps: list[dict[int, LapRow]] = [
        {row.lap["number"]: row for row in lap_rows(each.run.result.laps, None)} for each in runs
    ]
    rows = []
    for number in range(1, max(0, *(max(own, default=0) for own in laps)) + 1):
        first = _time_of(laps[0].get(number))
        for each, own in zip(runs, laps, strict=True):
            if (row := own.get(number)) is not None:
                time = _time_of(row)
                gap = None if not each.number or first is None or time is None else time - first
                rows.append(lap_of_run(each, row, gap))
    return rows


def lap_of_run(of: ReplayedRun, row: LapRow, gap_ms: int | None) -> SafeString:
    """A row of the table of laps, drawn once for the same values. ``gap_ms``: to the same lap of the first run."""
    look, lap, is_shown = of.look, row.lap, row.lap["number"] == of.lap
    of_lap = lap["number"], lap["time_ms"], lap["complete"], lap["completion_percentage"], *row.sectors
    values = {"row": row, "name": of.name, "look": look, "gap_ms": gap_ms, "is_shown": is_shown}
    key = (of.name, look.shell, look.colour, gap_ms, is_shown, *of_lap)
    return lasting_piece("races/replays/lap_of_run.html", values, key=key)


def _time_of(row: LapRow | None) -> int | None:
    return row.lap["time_ms"] if row is not None and row.lap["complete"] else None


def _offers(
    request: HttpRequest, shown: Evaluation, runs: Sequence[ReplayedRun], beside: Sequence[tuple[str, str]]
) -> list[SafeString]:
    """Rows of the runs that are not on the page yet, each with the address that adds it."""
    here = {each.run.pk for each in runs}
    lap = request.GET.get("lap", "")
    offers = offers_to_compare(shown, request.user, race_of(shown), spoilers_of(request).hidden)
    return [
        offer_of_run(offer, _with(shown, lap, [*beside, (offer.evaluation.public_id, "")]))
        for offer in offers
        if offer.evaluation.pk not in here
    ]


def offer_of_run(offer: RunOffer, address: str) -> SafeString:
    """A row of the table of offered runs, drawn once for the same values."""
    run, race = offer.evaluation, offer.race
    of_race = race and (race.name, race.race_type)
    key = (run.model.name, run.owner.shown_name, of_race, run.result.best_lap_ms, offer.gap_ms, offer.why)
    row = lasting_piece("races/replays/offer.html", {"offer": offer, "address": hole("address")}, key=key)
    return filled(row, address=escape(address))
