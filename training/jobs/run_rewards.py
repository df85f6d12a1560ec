"""The rewards of a training's function along runs of its models, for their telemetry."""

import hashlib
from collections.abc import Sequence

from django.core.cache import cache
from django.db.models import Q

from accounts.models import Racer
from evaluation.models import Evaluation
from paddock.rules.race import HEAD_TO_HEAD
from races.telemetry.rewards import RewardFunction

from ..rewards.check_slots import one_check
from .selectors import visible_trainings

KEPT_S = 7 * 24 * 3600


def rewards_of_runs(runs: Sequence[Evaluation], reader: Racer) -> dict[int, RewardFunction]:
    """The functions of the trainings that made the models of ``runs``, of those that the reader may see. None for runs
    with other cars: what was around the car is not in its trace."""
    alone = [run for run in runs if run.spec["rules"].get("race_type") != HEAD_TO_HEAD]
    models = {run.model_id for run in alone}
    if not models:
        return {}
    jobs = visible_trainings(reader).filter(Q(best_model__in=models) | Q(last_model__in=models))
    codes: dict[int, str] = {}
    for job in jobs.order_by("pk").only("best_model", "last_model", "reward_code"):
        codes |= {model: job.reward_code for model in (job.best_model_id, job.last_model_id) if model is not None}
    return {run.pk: _function(run, codes[run.model_id], reader) for run in alone if run.model_id in codes}


def _function(run: Evaluation, code: str, reader: Racer) -> RewardFunction:
    key = hashlib.sha256(code.encode()).hexdigest()

    def along(lap: int) -> dict[int, float]:
        kept = f"rewards:{key}:{run.public_id}:{run.result.trace_sha256}:{lap}"
        found = cache.get(kept)
        if found is None:
            with one_check(reader):
                found = _rewards(run, code, lap)
            cache.set(kept, found, KEPT_S)
        return dict(found)

    return RewardFunction(key, along)


def _rewards(run: Evaluation, code: str, lap: int) -> list[tuple[int, float]]:
    """The rewards of a lap with the trace's rows. Raises PaddockError: the first problem of the function where it gave
    none."""
    # the simulator comes along, which no other page needs
    from ..rewards.laboratory.recorded_lap import driven_rows, rewards_along
    from ..rewards.laboratory.views import driven_lap

    _track, states, columns = driven_lap(run, lap - 1)
    given = rewards_along(code, states)
    rows = driven_rows(columns, lap - 1)
    found = [(row, reward) for row, reward in zip(rows, given.rewards, strict=False) if reward is not None]
    if given.problems and not found:
        raise given.problems[0].fault
    return found
