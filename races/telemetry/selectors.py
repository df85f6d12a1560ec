"""The laps that a request asks telemetry of."""

import gzip

from django.http import HttpRequest
from django.utils.translation import gettext as _
from rest_framework.request import Request

from evaluation.models import Evaluation, State
from paddock.analysis.telemetry import DrivenTrace
from paddock.errors import UserFault
from races.replays.comparison import best_lap, driven_trace
from races.replays.selectors import direction_of, refuse_incomparable
from races.web.views import MOST_RUNS, visible_evaluations
from tracks.models import ReferenceLap
from tracks.reference.selectors import reference_ms

from .document import AskedLap
from .rewards import RewardFunction, reward_functions

REFERENCE = "reference"


def asked_laps(request: HttpRequest | Request, shown: Evaluation) -> list[AskedLap]:
    """The lap ``lap`` of a finished run and those of ``with``, each an id, an id and its lap (``id:2``), or
    ``reference``; the best lap of each unless the address has its number; ``reward=1``: with the rewards that the
    reader may see. Raises UserFault ``compare_unknown``, ``compare_lap`` and those of :func:`refuse_incomparable`."""
    if shown.state != State.FINISHED:
        raise UserFault("compare_no_result")
    wanted: dict[str, str] = {}
    for text in ",".join(request.GET.getlist("with")).split(","):
        public_id, _colon, lap = text.strip().partition(":")
        if public_id:
            wanted.setdefault(public_id[:64], lap)
    known = visible_evaluations(request, [each for each in wanted if each != REFERENCE][: MOST_RUNS - 1])
    rewards = reward_functions([shown, *known.values()], request.user) if request.GET.get("reward") == "1" else {}
    laps = [asked_lap(shown, asked_number(shown, request.GET.get("lap", "")), rewards.get(shown.pk))]
    for public_id, lap in list(wanted.items())[: MOST_RUNS - 1]:
        if public_id == REFERENCE and (reference := asked_reference(shown)):
            laps.append(reference)
            continue
        if public_id not in known:
            raise UserFault("compare_unknown")
        refuse_incomparable(shown, known[public_id])
        run = known[public_id]
        laps.append(asked_lap(run, asked_number(run, lap), rewards.get(run.pk)))
    return laps


def asked_lap(run: Evaluation, number: int = 0, rewards: RewardFunction | None = None) -> AskedLap:
    """A lap of a run, its best one for 0."""
    result = run.result
    return AskedLap(
        run=run.public_id,
        name=f"{run.owner.shown_name} · {run.model.name}",
        number=number or best_lap(result.laps),
        track=run.track,
        direction=direction_of(run),
        laps=result.laps,
        trace_sha256=result.trace_sha256,
        read=lambda: driven_trace(result),
        rewards=rewards,
    )


def asked_reference(run: Evaluation) -> AskedLap | None:
    """The reference lap of a run's track, direction and engine; None until it is driven."""
    direction, engine = direction_of(run), run.result.engine
    if reference_ms(run.track_id, direction, engine) is None:
        return None
    found = ReferenceLap.objects.filter(track=run.track_id, direction=direction, engine=engine).defer("trace").first()
    if found is None or not found.laps:
        return None
    return AskedLap(
        run=REFERENCE,
        name=_("Reference lap"),
        number=best_lap(found.laps),
        track=run.track,
        direction=direction,
        laps=found.laps,
        trace_sha256=found.trace_sha256,
        read=lambda: DrivenTrace.of(gzip.decompress(found.trace)),
    )


def asked_number(run: Evaluation, asked: str) -> int:
    """The lap that a query names, the best one where it names none. Raises UserFault ``compare_lap``."""
    laps = run.result.laps
    if not asked:
        return best_lap(laps)
    if not (asked.isascii() and asked.isdecimal() and len(asked) < 4):
        raise UserFault("compare_lap", lap=asked[:20], laps=len(laps))
    return int(asked)
