"""The ghosts that a visitor may drive against."""

from collections.abc import Collection
from typing import NamedTuple

from django.contrib.auth.models import AnonymousUser
from django.db.models import Q

from accounts.models import Racer
from evaluation.models import Evaluation, State
from paddock.geometry.track import CCW
from races.entries.selectors.visibility import evaluations_visible_to
from races.models import Duel, Submission
from races.replays.comparison import best_lap
from tracks.models import Track

GHOSTS = 12
_LOOKED_AT = 60  # the fastest runs, of which each racer's first is a ghost


class GhostOffer(NamedTuple):
    """A run, and its best lap."""

    run: Evaluation
    lap: int


def ghosts_on(
    track: Track, direction: str, reader: Racer | AnonymousUser, hidden: Collection[int] = ()
) -> list[GhostOffer]:
    """The fastest visible run of each racer on the track in the direction, the fastest first. ``hidden``: races whose
    results are spoilers."""
    driven = Q(spec__rules__direction=direction)
    if direction == CCW:
        driven |= Q(spec__rules__direction=None)
    runs = evaluations_visible_to(reader).filter(
        driven, track=track, state=State.FINISHED, result__best_lap_ms__isnull=False
    )
    if hidden:
        in_race = Submission.objects.filter(entry__race__in=hidden).values("evaluation")
        runs = runs.exclude(pk__in=in_race)
        runs = runs.exclude(pk__in=Duel.objects.filter(race__in=hidden).values("evaluation"))
    runs = runs.select_related("result").defer("result__trajectory", "track__npy")
    found: dict[int | None, Evaluation] = {}
    for run in runs.order_by("result__best_lap_ms", "pk")[:_LOOKED_AT]:
        found.setdefault(run.owner_id, run)
    return [GhostOffer(run, best_lap(run.result.laps)) for run in list(found.values())[:GHOSTS]]
