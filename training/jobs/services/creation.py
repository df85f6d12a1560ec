"""Creates a training; every refusal happens here, before anything runs."""

import dataclasses
import re
import secrets
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Any, Required, TypedDict, Unpack

from django.db import IntegrityError, transaction

from accounts.models import Racer
from accounts.quotas import limit_of, used_by
from core.database.columns import length_of
from core.database.locks import hold
from evaluation.garage.services import refuse_full_garage
from evaluation.models import TrainedModel
from evaluation.selectors import can_see_model
from paddock.errors import UserFault
from paddock.packages.inputs import IN_STEPS, lidar_settings
from paddock.packages.metadata import check_sensors
from paddock.rules.training import MOST_TRACKS, TrainingSettings
from races.entries.eligibility import check_eligible
from races.entries.terms import check_terms
from races.entries.time_checks import require_open
from races.models import Race
from races.models.sensors import require_offered
from races.test_runs.rules import own_rules
from tracks.models import Track

from ...cloning.selectors import build_of_model
from ...models import JobState, NeuralNetwork, TrainingJob, TrainingTrack, Vehicle
from ...quotas import AT_ONCE, MINUTES
from ..selectors import closing_fault, minutes_left
from ..settings_checks import check_action_space, check_hyperparameters, check_settings
from .layout import check_layout, options_of_a_test
from .queue import TRAININGS

NAME = re.compile(r"[A-Za-z0-9-]{1,64}")
DESCRIPTION_LIMIT = length_of(TrainingJob, "description")
_GREATEST_SEED = 2**31 - 1
VEHICLE_COLUMNS = ("sensors", "lidar_config", "neural_network", "shell", "colour")


class TrainingFields(TypedDict, total=False):
    """What a training is made of beside its settings.

    ``vehicle=None``: one camera and the shallow network. ``clone_from``: the training begins with the weights of this
    model. ``evaluate_on``: where the best model is driven for its owner when the training is done.
    """

    name: Required[str]
    track: Required[Track]
    reward_code: Required[str]
    description: str
    vehicle: Vehicle | None
    submit_to_race: Race | None
    evaluate_on: Track | None
    clone_from: TrainedModel | None


def create_training(
    *,
    owner: Racer,
    settings: TrainingSettings,
    now: datetime,
    more_tracks: Sequence[Track] = (),
    **fields: Unpack[TrainingFields],
) -> TrainingJob:
    """Put a training into the queue; a trainer is woken once the transaction is committed.

    ``more_tracks``: its episodes drive on these as well as on ``track``, and its evaluations on each.

    Raises PlatformFault ``training_unavailable``, ``training_paused``; UserFault ``training_...``, ``clone_...``,
    ``garage_full``, ``storage_full``, ``description_too_long``, ``vehicle_not_yours``, ``race_track_without_shape``,
    the race's own faults (not open, other sensors, racer not eligible), and the faults that
    :func:`paddock.simulator.layout.lay_out` raises for boxes.
    """
    if (closed := closing_fault()) is not None:
        raise closed
    for fault in refusals_of(owner=owner, settings=settings, now=now, more_tracks=more_tracks, **fields):
        raise fault
    job = _job(owner, settings, now, fields)
    with transaction.atomic():
        hold(owner)
        refuse_taken_name(owner, job.name)
        _refuse_full_quota(owner, settings.stop_minutes, now)
        try:
            with transaction.atomic():
                job.save(force_insert=True)
                TrainingTrack.objects.bulk_create(
                    TrainingTrack(job=job, track=one, place=place) for place, one in enumerate(more_tracks, start=1)
                )
        except IntegrityError as error:
            if "name" in str(error):
                raise UserFault("training_name_taken", name=job.name) from None
            raise
        TRAININGS.wake()
    return job


def refusals_of(
    *,
    owner: Racer,
    settings: TrainingSettings,
    now: datetime,
    more_tracks: Sequence[Track] = (),
    **fields: Unpack[TrainingFields],
) -> Iterator[UserFault]:
    """Every reason for which :func:`create_training` would refuse these arguments, in its order."""
    if not NAME.fullmatch(fields["name"]):
        yield UserFault("training_name_form")
    if len(fields.get("description") or "") > DESCRIPTION_LIMIT:
        yield UserFault("description_too_long", limit=DESCRIPTION_LIMIT)
    if not fields["reward_code"].strip():
        yield UserFault("training_reward_missing")
    vehicle = fields.get("vehicle")
    if vehicle is not None and vehicle.owner_id != owner.pk:
        yield UserFault("vehicle_not_yours")
        return
    try:
        check_settings(settings)
        job = _job(owner, settings, now, fields)
        check_sensors(job.sensors)  # a vehicle's are checked when it is made; this one may have been made by hand
    except UserFault as fault:  # the other checks need all of these
        yield fault
        return
    race, track, model = job.submit_to_race, job.evaluate_on, job.cloned_from
    checks: list[Any] = [
        partial(_check_tracks, job.track, more_tracks),
        partial(check_layout, job, more_tracks),
        race and partial(_check_race, job, race, now),
        track and partial(_check_evaluation, job, track),
        model and partial(_check_clone, job, model),
        partial(refuse_full_garage, owner),
        partial(refuse_taken_name, owner, job.name),
        partial(_refuse_full_quota, owner, settings.stop_minutes, now),
    ]
    for check in filter(None, checks):
        try:
            check()
        except UserFault as fault:
            yield fault


def _job(owner: Racer, settings: TrainingSettings, now: datetime, fields: TrainingFields) -> TrainingJob:
    columns = {"cloned_from" if name == "clone_from" else name: value for name, value in fields.items()}
    columns |= {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
    columns |= {name: getattr(fields.get("vehicle") or Vehicle(), name) for name in VEHICLE_COLUMNS}
    columns |= {
        "boxes": [dict(box) for box in settings.boxes],
        "hyperparameters": check_hyperparameters(settings.algorithm, settings.hyperparameters),
        "action_space": check_action_space(settings.algorithm, settings.action_space_type, settings.action_space),
        "seed": secrets.randbelow(_GREATEST_SEED) if settings.seed is None else settings.seed,
    }
    return TrainingJob(owner=owner, created_at=now, **columns)


def _check_tracks(track: Track, more: Sequence[Track]) -> None:
    if 1 + len(more) > MOST_TRACKS or len({track.pk, *(one.pk for one in more)}) != 1 + len(more):
        raise UserFault("training_tracks", limit=MOST_TRACKS)


def _check_race(job: TrainingJob, race: Race, now: datetime) -> None:
    require_open(race, now)
    require_offered(job.sensors, race.sensors)
    check_eligible(race, job.owner, now)
    check_terms(race, job.owner)


def _check_evaluation(job: TrainingJob, track: Track) -> None:
    """Whether the model can be tried on this track as it is trained on its own."""
    try:
        own_rules(track, options_of_a_test(job))
    except UserFault as fault:
        raise UserFault("training_evaluate_on", track=track.name, problem=str(fault)) from None


def _check_clone(job: TrainingJob, model: TrainedModel) -> None:
    if not can_see_model(job.owner, model):
        raise UserFault("clone_not_yours")
    has, wanted = model.metadata, job.metadata
    if has.get("frame_stack", 1) > 1:
        raise UserFault("clone_frame_stack", count=has["frame_stack"])
    if sorted(has["sensor"]) != sorted(wanted["sensor"]) or (
        IN_STEPS in has["sensor"]
        and lidar_settings(has.get("lidar_config")) != lidar_settings(wanted.get("lidar_config"))
    ):
        raise UserFault("clone_sensors", has=", ".join(has["sensor"]), wanted=", ".join(wanted["sensor"]))
    networks = [one.get("neural_network", NeuralNetwork.SHALLOW.value) for one in (has, wanted)]
    if networks[0] != networks[1]:
        raise UserFault("clone_network", has=networks[0], wanted=networks[1])
    actions = [_actions(one) for one in (has, wanted)]
    if actions[0] != actions[1]:
        raise UserFault("clone_actions", has=actions[0], wanted=actions[1])
    if build_of_model(model) is None:
        raise UserFault("clone_not_ours")


def _actions(metadata: Mapping[str, Any]) -> str:
    kind = metadata.get("action_space_type", "discrete")
    return f"{len(metadata['action_space'])} {kind}" if kind == "discrete" else kind


def refuse_taken_name(owner: Racer, name: str) -> None:
    """Raises UserFault("training_name_taken")."""
    waiting = TrainingJob.objects.filter(owner=owner, name=name, state__in=(JobState.QUEUED, JobState.RUNNING))
    if waiting.exists() or TrainedModel.objects.filter(owner=owner, name=name, deleted_at=None).exists():
        raise UserFault("training_name_taken", name=name)


def _refuse_full_quota(owner: Racer, minutes: int, now: datetime) -> None:
    limit = limit_of(owner, AT_ONCE.name)
    if used_by(owner, AT_ONCE.name, now) >= limit:
        raise UserFault("training_jobs_at_once", limit=limit)
    left = minutes_left(owner, now)
    if minutes > left:
        raise UserFault("training_minutes_left", left=int(left), limit=limit_of(owner, MINUTES.name))
