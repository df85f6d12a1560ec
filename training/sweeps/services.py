"""Creates, advances, stops and deletes sweeps. A sweep has at most one training under way."""

import logging
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from importlib.util import find_spec
from typing import Any, TypedDict, Unpack

from django.db import transaction
from django.db.models import Exists, OuterRef, QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.database.locks import hold
from core.streams import poke_after_commit
from paddock.errors import PlatformFault, UserFault
from paddock.rules.training import DRIVEN_BY, KEPT, TrainingSettings
from tracks.models import Track

from ..jobs.services.creation import NAME, VEHICLE_COLUMNS, TrainingFields, create_training, refusals_of
from ..jobs.services.deletion import delete_training, drop_checkpoints
from ..jobs.services.queue import TRAININGS, stop_training
from ..models import Checkpoint, JobState, Sweep, SweepState, SweepTrial, TrainingJob, TrainingTrack
from ..models.choices import FINAL_STATES, UNDER_WAY, RewardSignature
from ..models.sweep import NAME_LIMIT, ActionSpaceChoice, SearchSpace, TrialSetting
from ..starter_training.services import free_name
from .halving import Begin, Continue, next_move, plan
from .selectors import TrialRow, facts_of, ranked, rows_of
from .space import check_size, checked_space

logger = logging.getLogger(__name__)
# What every trial has of the first one's training.
_SHARED = (
    *("owner", "description", "track", *DRIVEN_BY, *KEPT, "algorithm", "vehicle", *VEHICLE_COLUMNS, "seed"),
    *("cloned_from", "submit_to_race", "evaluate_on"),
)


class SearchFields(TypedDict, total=False):
    """What the trials differ in, beside the settings of the base training."""

    hyperparameters: Mapping[str, Mapping[str, Any]]
    action_spaces: Sequence[ActionSpaceChoice]
    reward_functions: Sequence[str]


class TrialFields(TrainingFields, total=False):
    more_tracks: Sequence[Track]


def create_sweep(
    *,
    owner: Racer,
    settings: TrainingSettings,
    count: int,
    budget_s: int,
    search: SearchFields,
    now: datetime,
    more_tracks: Sequence[Track] = (),
    **fields: Unpack[TrainingFields],
) -> Sweep:
    """Begin a sweep of ``count`` settings with its first trial, which has the settings of the base training.

    The budget counts as the time limit of one training. Raises as :func:`create_training`, and UserFault
    ``sweep_...``.
    """
    if find_spec("optuna") is None:
        raise PlatformFault("training_unavailable")
    base: TrialFields = {**fields, "more_tracks": more_tracks}
    space, asked = _checked(owner, settings, count, budget_s, search, now, base)
    name = fields["name"]
    with transaction.atomic():
        hold(owner)
        if Sweep.objects.filter(owner=owner, name=name, state=SweepState.RUNNING).exists():
            raise UserFault("sweep_name_taken", name=name)
        job = create_training(owner=owner, settings=asked, now=now, **base | {"name": free_name(owner, f"{name}-1")})
        TrainingJob.objects.filter(pk=job.pk).update(stop_seconds=plan(count, budget_s)[0].seconds, keeps_models=False)
        sweep = Sweep.objects.create(
            owner=owner,
            name=name,
            space=space,
            settings_count=count,
            budget_s=budget_s,
            seed=secrets.randbelow(2**31 - 1) if settings.seed is None else settings.seed,
            created_at=now,
        )
        setting: TrialSetting = {
            "hyperparameters": {one: job.hyperparameters[one] for one in space["hyperparameters"]},
            "action_space": 0,
            "reward_function": 0,
        }
        SweepTrial.objects.create(sweep=sweep, number=1, setting=setting, job=job)
    return sweep


def _checked(
    owner: Racer,
    settings: TrainingSettings,
    count: int,
    budget_s: int,
    search: SearchFields,
    now: datetime,
    base: TrialFields,
) -> tuple[SearchSpace, TrainingSettings]:
    """The search space, and the settings of the first trial's training: it ends by time alone, and its time limit is
    the whole budget for the checks of quotas. Raises UserFault."""
    if not NAME.fullmatch(base["name"]) or len(base["name"]) > NAME_LIMIT:
        raise UserFault("sweep_name_form", limit=NAME_LIMIT)
    kind, actions = settings.action_space_type, settings.action_space
    first: ActionSpaceChoice = {"action_space_type": kind, "action_space": actions}
    space = checked_space(
        algorithm=settings.algorithm,
        base=first,
        reward_code=base["reward_code"],
        hyperparameters=search.get("hyperparameters", {}),
        action_spaces=search.get("action_spaces", ()),
        reward_functions=search.get("reward_functions", ()),
    )
    check_size(space, count, budget_s)
    minutes = max(1, -(-budget_s // 60))
    asked = replace(settings, stop_minutes=minutes, stop_steps=None, stop_clean_laps=None)
    for one in space["action_spaces"]:
        for fault in refusals_of(owner=owner, settings=replace(asked, **one), now=now, **base):
            raise fault
    return space, asked


# --- the next step, by a trainer


def sweeps_due() -> QuerySet[Sweep]:
    """Running sweeps whose last training has ended."""
    under_way = TrainingJob.objects.filter(trial__sweep=OuterRef("pk"), state__in=UNDER_WAY)
    return Sweep.objects.filter(~Exists(under_way), state=SweepState.RUNNING)


def advance_sweeps(*, now: datetime) -> int:
    """Begin, continue or conclude each sweep whose last training has ended; the number of these. A trainer calls it
    before it claims a training. A sweep whose next step cannot be decided ends with ``sweep_broke_down``, which its
    page shows."""
    if find_spec("optuna") is None:
        return 0  # a trainer of an older installation: another one advances them
    advanced = 0
    for sweep in sweeps_due().select_related("owner"):
        try:
            advanced += advance_sweep(sweep=sweep, now=now)
        except (LookupError, RuntimeError, TypeError, ValueError):  # Optuna refuses a space or trial; a damaged row
            logger.exception("Sweep %s cannot advance.", sweep.public_id)
            _break_down(sweep, now)
    return advanced


@transaction.atomic
def _break_down(sweep: Sweep, now: datetime) -> None:
    hold(sweep)
    if sweeps_due().filter(pk=sweep.pk).exists():
        _end(sweep, SweepState.FAILED, now, reason=("sweep_broke_down", {}))
        poke_after_commit((f"sweep:{sweep.public_id}",))


def advance_sweep(*, sweep: Sweep, now: datetime) -> bool:
    """The next step of a sweep, decided outside of the transaction that writes it. False: another worker was faster."""
    rows = rows_of(sweep)
    move: Begin | Continue | None = None
    setting: TrialSetting | None = None
    if sweep.stop_asked_at is None:
        from . import study  # imports Optuna, which only trainers need

        facts = [facts_of(row) for row in rows]
        move = next_move(sweep.settings_count, sweep.budget_s, facts, study.continuing)
        if isinstance(move, Begin):
            known = [
                (row.trial.setting, one.results[0][0] if one.results else None)
                for row, one in zip(rows, facts, strict=True)
            ]
            setting = study.suggest(sweep.space, known, seed=sweep.seed)
    with transaction.atomic():
        hold(sweep)
        if not sweeps_due().filter(pk=sweep.pk, stop_asked_at=sweep.stop_asked_at).exists() or _seen(rows) != _seen(
            rows_of(sweep)
        ):
            return False
        if isinstance(move, Begin) and setting is not None:
            _begin(sweep, rows[0].trial.job, setting, move.seconds, len(rows) + 1, now)
        elif isinstance(move, Continue):
            _continue(rows[move.index].trial.job, stop_seconds=move.until_s, keeps_models=move.last)
        else:
            _conclude(sweep, rows, now)
        poke_after_commit((f"sweep:{sweep.public_id}",))
    return True


def _seen(rows: Sequence[TrialRow]) -> list[tuple[str, int, bool]]:
    return [(row.trial.job.state, len(row.trial.results), row.trial.job.keeps_models) for row in rows]


def _begin(sweep: Sweep, base: TrainingJob, setting: TrialSetting, seconds: float, number: int, now: datetime) -> None:
    code = sweep.space["reward_functions"][setting["reward_function"]]
    job = TrainingJob.objects.create(
        **{name: getattr(base, name) for name in _SHARED},
        name=free_name(sweep.owner, f"{sweep.name}-{number}"),
        hyperparameters={**base.hyperparameters, **setting["hyperparameters"]},
        **sweep.space["action_spaces"][setting["action_space"]],
        reward_code=code,
        reward_signature=RewardSignature.of(code),
        stop_seconds=seconds,
        keeps_models=False,
        created_at=now,
    )
    TrainingTrack.objects.bulk_create(
        TrainingTrack(job=job, track=track, place=place) for place, track in enumerate(base.tracks[1:], start=1)
    )
    SweepTrial.objects.create(sweep=sweep, number=number, setting=setting, job=job)
    TRAININGS.wake()


def _continue(job: TrainingJob, **columns: Any) -> None:
    """Queue a trial's training again; it goes on from its checkpoint."""
    TRAININGS.begin_anew(
        TrainingJob.objects.filter(pk=job.pk, state__in=FINAL_STATES), ended_because="", failures=0, **columns
    )


def _conclude(sweep: Sweep, rows: Sequence[TrialRow], now: datetime) -> None:
    """End the sweep with the best trial's model; where there is none, a trainer first makes it of the checkpoint."""
    stored = set(
        Checkpoint.objects.filter(job__trial__sweep=sweep).exclude(networks="").values_list("job_id", flat=True)
    )
    for row in ranked(rows):
        job = row.trial.job
        if job.best_model_id is not None:
            _end(sweep, SweepState.FINISHED if sweep.stop_asked_at is None else SweepState.STOPPED, now, row.trial)
            return
        if row.score is not None and job.pk in stored and not job.keeps_models:
            _continue(job, keeps_models=True, stop_asked_at=sweep.stop_asked_at or now, stopped_by=None)
            return
    failed = next((row.trial.job for row in rows if row.trial.job.state == JobState.FAILED), None)
    if sweep.stop_asked_at is not None:
        _end(sweep, SweepState.STOPPED, now)
    elif failed is not None:
        _end(sweep, SweepState.FAILED, now, reason=(failed.reason_code, failed.reason_params))
    else:
        _end(sweep, SweepState.FAILED, now, reason=("sweep_without_model", {}))


def _end(
    sweep: Sweep,
    state: SweepState,
    now: datetime,
    best: SweepTrial | None = None,
    reason: tuple[str, dict[str, object]] = ("", {}),
) -> None:
    for trial in SweepTrial.objects.filter(sweep=sweep).select_related("job"):
        drop_checkpoints(trial.job)
    code, params = reason
    Sweep.objects.filter(pk=sweep.pk).update(
        state=state, best=best, ended_at=now, reason_code=code, reason_params=params
    )


# --- by hand


@audited("sweep.stopped", _("Sweep stopped"), target="sweep", unless="owner")
@transaction.atomic
def stop_sweep(*, sweep: Sweep, now: datetime, by: Racer | None = None) -> bool:
    """Stop a sweep; its best trial so far becomes a model. False if it had ended already, or was stopped before."""
    hold(sweep)
    asked = Sweep.objects.filter(pk=sweep.pk, state=SweepState.RUNNING, stop_asked_at=None).update(stop_asked_at=now)
    if asked:
        for job in TrainingJob.objects.filter(trial__sweep=sweep, state__in=UNDER_WAY):
            stop_training(job=job, now=now, by=by)
        sweep.refresh_from_db()
        if not TrainingJob.objects.filter(trial__sweep=sweep).exclude(started_at=None).exists():
            _end(sweep, SweepState.STOPPED, now)  # nothing has begun
        TRAININGS.wake()
        poke_after_commit((f"sweep:{sweep.public_id}",))
    sweep.refresh_from_db()
    return bool(asked)


@transaction.atomic
def delete_sweep(*, sweep: Sweep, now: datetime) -> int:
    """Delete a sweep with its trials' trainings; models stay. The bytes of its files. Raises UserFault
    ``sweep_running``."""
    hold(sweep)
    if not Sweep.objects.get(pk=sweep.pk).is_final:
        raise UserFault("sweep_running")
    jobs = list(TrainingJob.objects.filter(trial__sweep=sweep))
    sweep.delete()
    return sum(delete_training(job=job, now=now) for job in jobs)
