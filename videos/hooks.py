"""The registry through which the room above supplies the visibility and titles of runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from django.db.models import QuerySet

from evaluation.models import Evaluation

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

    Viewer = Racer | AnonymousUser | None


@dataclass(frozen=True)
class Runs:
    """The functions that the room above supplies.

    ``titles``: title and subtitle of a run's video in a language. ``fastest_sectors_ms``: the race's best sector times,
    empty for a run without colours. ``related``: relations of a run to read with it. ``shown_together``: whether every
    reader of the first of these runs (public ids) may see all of them.
    """

    can_see: Callable[[Viewer, Evaluation], bool]
    visible_to: Callable[[Viewer], QuerySet[Evaluation]]
    titles: Callable[[Evaluation, str], tuple[str, str]]
    fastest_sectors_ms: Callable[[Evaluation], Sequence[int | None]]
    related: tuple[str, ...] = ()
    shown_together: Callable[[Sequence[str]], bool] = lambda runs: False


_known: list[Runs] = []


def register_runs(runs: Runs) -> None:
    """Register the functions once, at the start of the site."""
    _known[:] = [runs]


def runs() -> Runs:
    """The registered functions. Raises LookupError without."""
    if not _known:
        raise LookupError("no room has registered its runs with the videos")
    return _known[0]
