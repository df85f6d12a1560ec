"""The laps that a request asks telemetry of."""

from django.http import HttpRequest
from rest_framework.request import Request

from evaluation.models import Evaluation, State
from paddock.errors import UserFault
from races.replays.comparison import best_lap
from races.replays.selectors import refuse_incomparable
from races.web.views import visible_evaluations

from .document import AskedLap

MOST_RUNS = 8


def asked_laps(request: HttpRequest | Request, shown: Evaluation) -> list[AskedLap]:
    """The lap ``lap`` of a finished run and those of ``with``, each an id, or an id and its lap (``id:2``); the best
    lap of each unless the address has its number. Raises UserFault ``compare_unknown``, ``compare_lap`` and those of
    :func:`refuse_incomparable`."""
    if shown.state != State.FINISHED:
        raise UserFault("compare_no_result")
    wanted: dict[str, str] = {}
    for text in ",".join(request.GET.getlist("with")).split(","):
        public_id, _colon, lap = text.strip().partition(":")
        if public_id:
            wanted.setdefault(public_id[:64], lap)
    known = visible_evaluations(request, list(wanted)[: MOST_RUNS - 1])
    runs = [(shown, request.GET.get("lap", ""))]
    for public_id, lap in list(wanted.items())[: MOST_RUNS - 1]:
        if public_id not in known:
            raise UserFault("compare_unknown")
        refuse_incomparable(shown, known[public_id])
        runs.append((known[public_id], lap))
    return [asked_lap(run, _number(run, lap)) for run, lap in runs]


def asked_lap(run: Evaluation, number: int = 0) -> AskedLap:
    """A lap of a run, its best one for 0."""
    return AskedLap(run, number or best_lap(run.result.laps), f"{run.owner.shown_name} · {run.model.name}")


def _number(run: Evaluation, asked: str) -> int:
    laps = run.result.laps
    if not asked:
        return 0
    if not (asked.isascii() and asked.isdecimal() and len(asked) < 4):
        raise UserFault("compare_lap", lap=asked[:20], laps=len(laps))
    return int(asked)
