"""Successive halving: which trial trains next, and for how long. Pure functions of the trials' results.

All settings train for the same short time, the best third continues for longer, and so on to a single one. Each rung
has the same share of what is left of the budget. Trials run one after another.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

REDUCTION = 3
LEAST_S = 5.0  # of the first rung: a trainer learns nothing in less

# The indexes of the scores that continue; the highest is the best.
Prune = Callable[[Sequence[float]], list[int]]


@dataclass(frozen=True)
class TrialFacts:
    """``results``: (score, seconds since the trial began) after each rung that it finished. ``failed``: it ended in the
    midst of a rung and cannot continue, after ``seconds``."""

    results: tuple[tuple[float, float], ...] = ()
    failed: bool = False
    seconds: float = 0.0


@dataclass(frozen=True)
class Begin:
    """Begin another trial, for so many seconds."""

    seconds: float


@dataclass(frozen=True)
class Continue:
    """Continue the trial of this index until its training has taken so many seconds; ``last``: in the last rung."""

    index: int
    until_s: float
    last: bool


@dataclass(frozen=True)
class Rung:
    """A rung of a plan: so many trials for so many seconds each."""

    trials: int
    seconds: float


def rungs_of(settings: int) -> list[int]:
    """The number of trials of each rung."""
    sizes = [settings]
    while sizes[-1] > 1:
        sizes.append(max(1, sizes[-1] // REDUCTION))
    return sizes


def plan(settings: int, budget_s: float) -> list[Rung]:
    """The rungs where no trial fails."""
    sizes = rungs_of(settings)
    return [Rung(size, budget_s / len(sizes) / size) for size in sizes]


def next_move(settings: int, budget_s: float, trials: Sequence[TrialFacts], prune: Prune) -> Begin | Continue | None:
    """What follows while no trial runs; None: the sweep is over."""
    rungs = len(rungs_of(settings))
    if len(trials) < settings:
        return Begin(budget_s / rungs / settings)
    entrants = list(range(settings))
    for rung in range(1, rungs):
        finished = [index for index in entrants if len(trials[index].results) >= rung]
        if not finished:
            return None
        scores = [trials[index].results[rung - 1][0] for index in finished]
        entrants = [finished[place] for place in prune(scores)]
        each = max(0.0, budget_s - sum(_spent(one, rung) for one in trials)) / (rungs - rung) / len(entrants)
        for index in entrants:
            if len(trials[index].results) == rung and not trials[index].failed:
                return Continue(index, trials[index].results[-1][1] + each, last=rung == rungs - 1)
    return None


def _spent(trial: TrialFacts, rung: int) -> float:
    """Seconds of the trial before this rung."""
    if len(trial.results) >= rung:
        return trial.results[rung - 1][1]
    return trial.seconds if trial.failed else trial.results[-1][1] if trial.results else 0.0
