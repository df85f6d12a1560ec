"""Sweeps that a racer sees, their trials in order of success, and how much each dimension mattered."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import correlation
from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.db.models import Prefetch, QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import pgettext

from accounts.models import Racer
from core.streams.topics import Viewer, is_known
from paddock.packages.metadata import CONTINUOUS
from paddock.rules.hyperparameters import HYPERPARAMETERS

from ..models import JobState, Sweep, SweepTrial, TrainingIteration
from ..models.sweep import TrialSetting
from ..rewards.examples import EXAMPLES
from .halving import TrialFacts
from .space import ACTION_SPACE, REWARD_FUNCTION, dimensions, value_in

STATES = ("queued", "running", "failed", "stopped", "pruned", "best")  # of a trial


def sweeps_of(racer: Racer | AnonymousUser) -> QuerySet[Sweep]:
    """The racer's sweeps, newest first."""
    return Sweep.objects.filter(owner_id=racer.pk).select_related("best__job__best_model")


def visible_sweeps(racer: Racer | AnonymousUser) -> QuerySet[Sweep]:
    """All that the racer may look at: their own; for admins all. Twin of :func:`can_see_sweep`."""
    return Sweep.objects.all() if racer.is_staff else Sweep.objects.filter(owner_id=racer.pk)


def can_see_sweep(racer: Racer | AnonymousUser, sweep: Sweep) -> bool:
    return racer.pk is not None and (racer.pk == sweep.owner_id or racer.is_staff)


def can_stop_sweep(racer: Racer | AnonymousUser, sweep: Sweep) -> bool:
    """Whether the racer may stop the sweep while it runs: its owner, or an admin."""
    return not sweep.is_final and can_see_sweep(racer, sweep)


def can_delete_sweep(racer: Racer | AnonymousUser, sweep: Sweep) -> bool:
    """Whether the racer may delete the sweep: its owner, once it is over."""
    return sweep.is_final and racer.pk == sweep.owner_id


@dataclass(frozen=True)
class TrialRow:
    """A trial with its best evaluation so far. ``points``: seconds, progress and lap of each evaluation; ``behind``:
    another trial has finished more rungs."""

    trial: SweepTrial
    progress: float | None
    lap_ms: int | None
    points: list[tuple[float, float, int | None]]
    behind: bool

    @property
    def score(self) -> float | None:
        return None if self.progress is None else score_of(self.progress, self.lap_ms)

    @property
    def rung(self) -> int:
        """The rung that it trains in or has finished last, from 1."""
        return max(1, len(self.trial.results) + (not self.trial.job.is_final))

    @property
    def state(self) -> str:
        """The state of its training; ``pruned`` if the sweep goes on without it, or ``best``."""
        trial, sweep = self.trial, self.trial.sweep
        if sweep.best_id == trial.pk:
            return "best"
        if trial.job.state != JobState.FINISHED:
            return trial.job.state
        return "pruned" if self.behind or sweep.is_final else "queued"

    @property
    def state_name(self) -> str:
        names = {"best": _("best"), "pruned": _("pruned"), "queued": pgettext("a trial", "waits for the others")}
        return str(self.trial.job.get_state_display() if self.trial.job.state == self.state else names[self.state])


def score_of(progress: float, lap_ms: int | None) -> float:
    """Progress first, then the best lap: at most 100 without a whole lap, above with one, and more for a faster one."""
    return progress + (1e5 / max(1, lap_ms) if lap_ms is not None and progress >= 100.0 else 0.0)


def rows_of(sweep: Sweep) -> list[TrialRow]:
    """The trials of a sweep by number. Two queries, however many there are."""
    columns = ("job_id", "number", "seconds", "eval_progress", "eval_lap_ms", "is_best")
    iterations = Prefetch("job__iterations", TrainingIteration.objects.only(*columns).order_by("number"))
    trials = SweepTrial.objects.filter(sweep=sweep).order_by("number").select_related("job__best_model")
    rows = []
    found = list(trials.prefetch_related(iterations))
    most = max((len(trial.results) for trial in found), default=0)
    for trial in found:
        trial.sweep = sweep
        looks = list(trial.job.iterations.all())
        best = next((one for one in looks if one.is_best), None)
        points = [(one.seconds, one.eval_progress, one.eval_lap_ms) for one in looks]
        progress, lap_ms = (None, None) if best is None else (best.eval_progress, best.eval_lap_ms)
        rows.append(TrialRow(trial, progress, lap_ms, points, behind=len(trial.results) < most))
    return rows


def facts_of(row: TrialRow) -> TrialFacts:
    trial = row.trial
    results = tuple((score_of(one["progress"], one["lap_ms"]), one["seconds"]) for one in trial.results)
    return TrialFacts(results, trial.job.state in (JobState.FAILED, JobState.STOPPED), trial.job.seconds_done)


def ranked(rows: Sequence[TrialRow]) -> list[TrialRow]:
    """The best trial first; those without an evaluation last."""
    return sorted(rows, key=lambda row: (row.score is None, -(row.score or 0.0), row.trial.number))


@dataclass(frozen=True)
class Importance:
    """``share``: of the differences in rank after the first rung that this dimension alone explains, 0 to 1."""

    name: str
    label: str
    share: float


def importances(sweep: Sweep, rows: Sequence[TrialRow]) -> list[Importance]:
    """How much each dimension mattered, the most first; nothing before three trials have finished the first rung.

    All are compared after the same time of training, by rank: one dimension's share is the squared rank correlation
    of a number, or the variance between the groups of choices."""
    done = [row for row in rows if row.trial.results]
    if len(done) < 3:
        return []
    scores = [score_of(row.trial.results[0]["progress"], row.trial.results[0]["lap_ms"]) for row in done]
    ranks = _ranks(scores)
    found = []
    for name in dimensions(sweep.space):
        values = [value_in(row.trial.setting, name) for row in done]
        numbers = [value for value in values if isinstance(value, int | float)]
        is_number = name in sweep.space["hyperparameters"] and len(numbers) == len(values)
        share = _correlation(_ranks(numbers), ranks) ** 2 if is_number else _between(values, ranks)
        found.append(Importance(name, dimension_label(name), share))
    return sorted(found, key=lambda one: -one.share)


def dimension_label(name: str) -> str:
    if name == ACTION_SPACE:
        return _("Action space")
    if name == REWARD_FUNCTION:
        return _("Reward function")
    return _(HYPERPARAMETERS[name].label)


def value_words(sweep: Sweep, setting: TrialSetting, name: str) -> str:
    """A trial's value of one dimension, as a word or a number."""
    value = value_in(setting, name)
    if name == REWARD_FUNCTION:
        code = sweep.space["reward_functions"][int(value)].strip()
        known = next((one.title for one in EXAMPLES if one.code.strip() == code), None)
        return _(known) if known else _("Function %(number)s") % {"number": int(value) + 1}
    if name == ACTION_SPACE:
        choice = sweep.space["action_spaces"][int(value)]
        space: Any = choice["action_space"]
        if choice["action_space_type"] == CONTINUOUS:
            return _("ranges, up to %(speed)s m/s") % {"speed": f"{space['speed']['high']:g}"}
        fastest = max(action["speed"] for action in space)
        return _("%(count)s actions, up to %(speed)s m/s") % {"count": len(space), "speed": f"{fastest:g}"}
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _ranks(values: Sequence[float]) -> list[float]:
    """The rank of each value from 0; equal values share the mean of their ranks."""
    return [sum(other < value for other in values) + (values.count(value) - 1) / 2 for value in values]


def _correlation(one: Sequence[float], other: Sequence[float]) -> float:
    return correlation(one, other) if len(set(one)) > 1 and len(set(other)) > 1 else 0.0


def _between(groups: Sequence[Any], ranks: Sequence[float]) -> float:
    mean = sum(ranks) / len(ranks)
    whole = sum((rank - mean) ** 2 for rank in ranks)
    between = 0.0
    for group in set(groups):
        own = [rank for value, rank in zip(groups, ranks, strict=True) if value == group]
        between += len(own) * (sum(own) / len(own) - mean) ** 2
    return between / whole if whole > 0 else 0.0


def sees_sweep(viewer: Viewer, key: str) -> bool:
    """Of the topic of a sweep."""
    return is_known(viewer) and visible_sweeps(viewer).filter(public_id=key).exists()
