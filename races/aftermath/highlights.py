"""Rule-based choice of a live event's highlights for a video.

Of the shown runs: up to three **crashes**, filled up with off tracks; the two longest **saves** (a wheel beyond the
line for 0.3 to 3 s, then a second on the track); the last 20 s of the **fastest lap**; the **closest finish** (in duels
the heat with the smallest gap, else the lap by which a neighbour missed the place). Two moments of one run never
overlap."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from typing import Self

from django.db.models import Q
from django.utils import translation
from django.utils.translation import gettext as _

from accounts.models import Racer
from core.times import clock
from evaluation.models import Evaluation, Result
from evaluation.running.results import read_trace
from paddock.errors import UserFault
from videos.models import REEL, Video
from videos.scenes import Segment
from videos.selectors import ShownVideo, shown_video
from videos.services import VideoRequest, request_reel

from ..live.selectors.events import live_standings
from ..live.selectors.runs import DrivenRun, driven_runs, without_withdrawn
from ..models import LiveEvent
from ..replays.document import trace_columns
from .watch_again import require_ended

_REEL = ("evaluation__result", "evaluation__track", "evaluation__owner", "evaluation__model", "asked_by")
CRASHES, SAVES = 3, 2
CRASH_MS = (3_000, 2_000)  # before and after
SAVE_MS = (2_000, 2_000)
SAVED_MS = (300, 3_000)  # how long a wheel is beyond the line
SAFE_MS = 1_000  # and how long none is, after it
LAP_MS, FINISH_MS = 20_000, 8_000


@dataclass(frozen=True)
class TracedStep:
    """A row of a trace: ms of the run, the field's status, whether all wheels are on the track."""

    t: int
    status: str
    on_track: bool


@dataclass(frozen=True)
class Highlight:
    """A moment to show. ``weight``: its order within its kind; ``words``: its caption in the present language."""

    kind: str
    run: DrivenRun
    start_ms: int
    end_ms: int
    weight: int
    words: Callable[[], str]

    def overlaps(self, other: Self) -> bool:
        same = self.run.slot.pk == other.run.slot.pk
        return same and self.start_ms < other.end_ms and other.start_ms < self.end_ms


def crashes_in(steps: Sequence[TracedStep]) -> Iterator[tuple[int, str]]:
    """When a car hit something ("crashed") or left the track ("off_track")."""
    for before, step in pairwise(steps):
        if step.status != before.status and step.status in ("crashed", "off_track"):
            yield step.t, step.status


def saves_in(steps: Sequence[TracedStep]) -> Iterator[tuple[int, int]]:
    """From when to when a car had a wheel beyond the line, and drove on."""
    begun: int | None = None
    for number, step in enumerate(steps):
        if step.status != "in_progress":
            begun = None
        elif not step.on_track:
            begun = step.t if begun is None else begun
        elif begun is not None:
            after = [one for one in steps[number:] if one.t <= step.t + SAFE_MS]
            drove_on = after[-1].t >= step.t + SAFE_MS - 100 and all(
                one.status == "in_progress" and one.on_track for one in after
            )
            if drove_on and SAVED_MS[0] <= step.t - begun <= SAVED_MS[1]:
                yield begun, step.t
            begun = None


def moments_of(event: LiveEvent) -> list[Highlight]:
    """The highlights in the order of the video, from the runs' traces. Raises UserFault ``results_not_yet``,
    ``highlights_none``, PlatformFault ``storage_failed``."""
    require_ended(event)
    runs = driven_runs(event)
    crashed, saved = [], []
    for run in runs:
        if run.standing is None:
            continue
        steps = _steps_of(run)
        crashed += [_crash(run, at, status) for at, status in crashes_in(steps)]
        saved += [_save(run, *times) for times in saves_in(steps)]
    chosen: list[Highlight] = []
    for moment in (_fastest(without_withdrawn(runs)), _closest(event, runs)):
        if moment is not None and not any(map(moment.overlaps, chosen)):
            chosen.append(moment)
    of_track = [
        *_first(sorted(crashed, key=lambda each: each.weight, reverse=True), chosen, CRASHES),
        *_first(sorted(saved, key=lambda each: each.weight, reverse=True), chosen, SAVES),
    ]
    order = {run.slot.pk: number for number, run in enumerate(runs)}
    of_track.sort(key=lambda each: (order[each.run.slot.pk], each.start_ms))
    found = [*of_track, *chosen]
    if not found:
        raise UserFault("highlights_none")
    return found


def segments_of(moments: Sequence[Highlight], language: str) -> list[Segment]:
    """The same for the video, with captions in a language."""
    with translation.override(language):
        return [
            Segment(moment.run.evaluation.public_id, moment.run.number, moment.start_ms, moment.end_ms, moment.words())
            for moment in moments
        ]


def ask_for_highlights(*, event: LiveEvent, by: Racer, language: str, now: datetime) -> VideoRequest:
    """Queue the event's video. Raises as :func:`moments_of` and :func:`videos.services.request_reel`."""
    segments = segments_of(moments_of(event), language)
    runs = evaluations_of(segments)
    return request_reel(evaluations=runs, segments=segments, by=by, language=language, now=now)


def latest_reel(event: LiveEvent, language: str) -> ShownVideo | None:
    """The latest video of an event's highlights in a language."""
    runs = Evaluation.objects.filter(Q(live_slot__event=event) | Q(duel__race=event.race)).values("pk")
    videos = Video.objects.filter(part=REEL, evaluation__in=runs, language=language).select_related(*_REEL)
    video = videos.order_by("-asked_at", "-pk").first()
    return None if video is None else shown_video(video)


def evaluations_of(segments: Sequence[Segment]) -> list[Evaluation]:
    """The runs of moments, with what a video reads of them."""
    related = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")
    return list(Evaluation.objects.filter(public_id__in={one.run for one in segments}).select_related(*related))


def _first(moments: Sequence[Highlight], besides: Sequence[Highlight], most: int) -> list[Highlight]:
    found: list[Highlight] = []
    for moment in moments:
        if len(found) < most and not any(map(moment.overlaps, [*besides, *found])):
            found.append(moment)
    return found


def _crash(run: DrivenRun, at: int, status: str) -> Highlight:
    def words() -> str:
        text = _("%(racer)s hits something") if status == "crashed" else _("%(racer)s leaves the track")
        return text % {"racer": run.alias}

    return Highlight("crash", run, max(0, at - CRASH_MS[0]), at + CRASH_MS[1], int(status == "crashed"), words)


def _save(run: DrivenRun, begun: int, ended: int) -> Highlight:
    return Highlight(
        "save",
        run,
        max(0, begun - SAVE_MS[0]),
        ended + SAVE_MS[1],
        ended - begun,
        lambda: _("%(racer)s saves it") % {"racer": run.alias},
    )


def _fastest(runs: Sequence[DrivenRun]) -> Highlight | None:
    laps = [(lap["time_ms"], number, run, lap) for number, run in enumerate(runs) for lap in run.complete]
    if not laps:
        return None
    time_ms, _number, run, lap = min(laps, key=lambda each: each[:2])
    end = lap["start_ms"] + time_ms
    return Highlight(
        "fastest",
        run,
        max(lap["start_ms"], end - LAP_MS),
        end,
        0,
        lambda: _("Fastest lap: %(racer)s, %(time)s") % {"racer": run.alias, "time": clock(time_ms)},
    )


def _closest(event: LiveEvent, runs: Sequence[DrivenRun]) -> Highlight | None:
    return _closest_heat(event, runs) if any(run.slot.duel_id for run in runs) else _closest_places(event, runs)


def _closest_heat(event: LiveEvent, runs: Sequence[DrivenRun]) -> Highlight | None:
    heats: dict[int, list[tuple[int, DrivenRun]]] = {}
    for run in runs:
        if len(run.complete) >= event.race.laps:
            last = run.complete[event.race.laps - 1]
            heats.setdefault(run.slot.pk, []).append((last["start_ms"] + last["time_ms"], run))
    found = []
    for cars in heats.values():
        if len(cars) > 1:
            (first_ms, first), (second_ms, second) = sorted(cars, key=lambda each: each[0])[:2]
            found.append((second_ms - first_ms, first_ms, first, second))
    if not found:
        return None
    gap_ms, end, first, second = min(found, key=lambda each: each[:2])
    return Highlight("closest", first, max(0, end - FINISH_MS), end + gap_ms, 0, _before(first, second, gap_ms))


def _closest_places(event: LiveEvent, runs: Sequence[DrivenRun]) -> Highlight | None:
    rows = [row for row in live_standings(event) if row.rank and row.standing and row.standing.score_ms is not None]
    gaps = [
        (after.standing.score_ms - before.standing.score_ms, before, after)  # type: ignore[union-attr,operator]
        for before, after in pairwise(rows)
    ]
    if not gaps:
        return None
    gap_ms, before, after = min(gaps, key=lambda each: (each[0], each[1].rank))
    mine = [run for run in runs if run.entry.pk == after.racer.entry_id and run.standing is not None]
    best = min(mine, key=lambda run: run.standing.key, default=None)  # type: ignore[union-attr]
    if best is None or best.standing is None:
        return None
    wanted = best.standing.best_lap_number
    lap = next((each for each in best.complete if each["number"] == wanted), None)
    if lap is None:
        return None
    end = lap["start_ms"] + lap["time_ms"]
    first = next(run for run in runs if run.entry.pk == before.racer.entry_id)
    return Highlight("closest", best, max(lap["start_ms"], end - FINISH_MS), end, 0, _before(first, best, gap_ms))


def _before(first: DrivenRun, second: DrivenRun, gap_ms: int) -> Callable[[], str]:
    values = {"first": first.alias, "second": second.alias, "gap": f"{gap_ms / 1000:.3f}"}
    return lambda: _("%(first)s before %(second)s by %(gap)s s") % values


def _steps_of(run: DrivenRun) -> list[TracedStep]:
    result = Result.objects.get(evaluation=run.evaluation)
    columns = trace_columns(read_trace(result if run.number == 0 else result.rivals.get(number=run.number)))
    steps = zip(columns["t"], columns["status"], columns["on_track"], strict=True)
    return [TracedStep(*step) for step in steps]
