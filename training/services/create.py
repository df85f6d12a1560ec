"""Taking on a training: everything that can be refused is refused here, before anything runs."""

from __future__ import annotations

import dataclasses
import re
import secrets
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from django.conf import settings as site
from django.db import IntegrityError, transaction

from accounts.quotas import limit_of, used_by
from core.columns import length_of
from core.locks import hold
from evaluation.looks import DEFAULT_COLOUR, Shell
from evaluation.models import TrainedModel
from evaluation.services.garage import refuse_full_garage
from paddock.errors import PlatformFault, UserFault
from paddock.packages.inputs import CAMERAS, LIDARS, SENSOR_NAMES, lidar_settings
from paddock.rules.race import RaceRules, other_direction
from paddock.rules.training import DRIVEN_BY, MOST_TRACKS, RANDOMISED, TrainingSettings
from paddock.simulator.layout import lay_out
from races.eligibility import check_eligible
from races.models import Race, RaceType
from races.own_rules import own_rules
from races.selectors.terms import check_terms
from races.sensors import not_offered
from races.services.gates import require_open
from tracks.models import Track

from ..cloning import build_of_model
from ..hyperparameters import check_action_space, check_hyperparameters, check_settings
from ..models import JobState, NeuralNetwork, TrainingJob, TrainingTrack, Vehicle
from ..models.vehicle import default_sensors
from ..quotas import AT_ONCE, MINUTES
from ..selectors import can_clone_model, minutes_left
from .jobs import TRAININGS

if TYPE_CHECKING:
    from accounts.models import Racer

NAME = re.compile(r"[A-Za-z0-9-]{1,64}")
DESCRIPTION_LIMIT = length_of(TrainingJob, "description")
_GREATEST_SEED = 2**31 - 1


def create_training(
    *,
    owner: Racer,
    name: str,
    track: Track,
    reward_code: str,
    settings: TrainingSettings,
    now: datetime,
    description: str = "",
    vehicle: Vehicle | None = None,
    submit_to_race: Race | None = None,
    evaluate_on: Track | None = None,
    clone_from: TrainedModel | None = None,
    more_tracks: Sequence[Track] = (),
) -> TrainingJob:
    """Put a training into the queue; a trainer is woken once the transaction is committed.

    ``more_tracks``: its episodes drive on these as well as on ``track``, and its evaluations on each.
    ``vehicle=None``: one camera and the shallow network. ``clone_from``: the training begins with the weights of this
    model. ``evaluate_on``: where the best model is driven for its owner when the training is done.

    Raises PlatformFault ``training_unavailable``, ``training_paused``; UserFault ``training_...``, ``clone_...``,
    ``garage_full``, ``storage_full``, ``description_too_long``, ``vehicle_not_yours``, ``race_track_without_shape``,
    what a race says that is not open, does not offer the sensors or not to this racer, and what
    :func:`paddock.simulator.layout.lay_out` says of boxes.
    """
    refuse_when_closed()
    fields = {
        "name": name,
        "description": description,
        "track": track,
        "vehicle": vehicle,
        "reward_code": reward_code,
        "submit_to_race": submit_to_race,
        "evaluate_on": evaluate_on,
        "clone_from": clone_from,
    }
    for fault in refusals_of(owner=owner, settings=settings, now=now, more_tracks=more_tracks, **fields):
        raise fault
    job = _job(owner, settings, now, fields)
    with transaction.atomic():
        hold(owner)
        refuse_taken_name(owner, name)
        _refuse_full_quota(owner, settings.stop_minutes, now)
        try:
            with transaction.atomic():
                job.save(force_insert=True)
                TrainingTrack.objects.bulk_create(
                    TrainingTrack(job=job, track=one, place=place) for place, one in enumerate(more_tracks, start=1)
                )
        except IntegrityError as error:
            if "name" in str(error):
                raise UserFault("training_name_taken", name=name) from None
            raise
        TRAININGS.wake()
    return job


def refusals_of(
    *,
    owner: Racer,
    settings: TrainingSettings,
    now: datetime,
    more_tracks: Sequence[Track] = (),
    **fields: Any,
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
        _check_sensors(job)
    except UserFault as fault:  # the other checks need all of these
        yield fault
        return
    checks = [partial(_check_tracks, job.track, more_tracks), partial(check_layout, job, more_tracks)]
    if job.submit_to_race is not None:
        checks.append(partial(_check_race, job, job.submit_to_race, now))
    if job.evaluate_on is not None:
        checks.append(partial(_check_evaluation, job, job.evaluate_on))
    if job.cloned_from is not None:
        checks.append(partial(_check_clone, job, job.cloned_from))
    checks.append(partial(refuse_full_garage, owner))
    checks.append(partial(refuse_taken_name, owner, job.name))
    checks.append(partial(_refuse_full_quota, owner, settings.stop_minutes, now))
    for check in checks:
        try:
            check()
        except UserFault as fault:
            yield fault


def _job(owner: Racer, settings: TrainingSettings, now: datetime, fields: Mapping[str, Any]) -> TrainingJob:
    """The training, not saved."""
    columns = {"cloned_from" if name == "clone_from" else name: value for name, value in fields.items()}
    return TrainingJob(owner=owner, created_at=now, **columns, **_asked(settings), **_worn(columns.get("vehicle")))


def _asked(settings: TrainingSettings) -> dict[str, Any]:
    """The settings as columns: each by its name, but for those that are checked or drawn on their way."""
    return {
        **{field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)},
        "boxes": [dict(box) for box in settings.boxes],
        "hyperparameters": check_hyperparameters(settings.algorithm, settings.hyperparameters),
        "action_space": check_action_space(settings.algorithm, settings.action_space_type, settings.action_space),
        "seed": secrets.randbelow(_GREATEST_SEED) if settings.seed is None else settings.seed,
    }


def refuse_when_closed() -> None:
    """Raises PlatformFault ``training_paused`` or ``training_unavailable``."""
    if site.TRAINING_PAUSED:
        raise PlatformFault("training_paused")
    if not site.TRAINING:
        raise PlatformFault("training_unavailable")


def clone_settings(model: TrainedModel) -> dict[str, Any]:
    """What a training that clones this model must have, and what it did have where it was trained here, as
    :func:`paddock.rules.training.taken_from` takes it. Action values and reward function may be changed;
    sensors and network not."""
    metadata = model.metadata
    settings_: dict[str, Any] = {
        "action_space_type": metadata.get("action_space_type", "discrete"),
        "action_space": metadata["action_space"],
        "algorithm": "sac" if metadata.get("training_algorithm") == "sac" else "ppo",
        "clone_from": model,
    }
    job = TrainingJob.objects.filter(best_model=model).first() or TrainingJob.objects.filter(last_model=model).first()
    if job is not None:
        names = ("track", *DRIVEN_BY, "hyperparameters", "reward_code", "reward_signature", "vehicle", "best_metric")
        settings_ |= {name: getattr(job, name) for name in (*names, "alternate_direction", *RANDOMISED)}
        settings_["more_tracks"] = job.tracks[1:]
    return settings_


def _check_tracks(track: Track, more: Sequence[Track]) -> None:
    """Raises UserFault ``training_tracks``."""
    if 1 + len(more) > MOST_TRACKS or len({track.pk, *(one.pk for one in more)}) != 1 + len(more):
        raise UserFault("training_tracks", limit=MOST_TRACKS)


def check_layout(job: TrainingJob, more_tracks: Sequence[Track] = ()) -> None:
    """Whether race type, boxes and bots go together and have room on each track, both ways round where it alternates.
    Raises UserFault."""
    if job.race_type == RaceType.HEAD_TO_HEAD and not job.bots:
        raise UserFault("training_course", problem="no bot cars")
    try:
        rules = RaceRules.from_dict({**layout_of(job), "race_type": job.race_type, "direction": job.direction})
    except (ValueError, TypeError) as error:
        raise UserFault("training_course", problem=str(error)[:200]) from None
    directions = (job.direction, *([other_direction(job.direction)] if job.alternate_direction else []))
    for track in (job.track, *more_tracks):
        if not track.has_shape:
            raise UserFault("race_track_without_shape", track=track.name)
        for direction in directions:
            lay_out(track.geometry.in_direction(direction), rules)


# Told where they are not as usual: while a site is upgraded, a trainer of before does not know them.
_CHANGES = ("bot_lane_change_m", "bot_lane_change_least_ms", "bot_lane_change_most_ms")


def layout_of(job: TrainingJob) -> dict[str, Any]:
    """The rules of what stands and drives on the track and of how laps begin, as the race type's environment takes
    them; nothing for a time trial without any."""
    layout: dict[str, Any] = {}
    if job.boxes or job.random_boxes:
        layout |= {"boxes": job.boxes, "random_boxes": job.random_boxes}
    if job.bots:
        layout |= {
            "bots": job.bots,
            "bot_speed_mps": job.bot_speed_mps,
            "bot_lane_changes": job.bot_lane_changes,
        }
        layout |= {name: getattr(job, name) for name in _CHANGES if getattr(job, name) != getattr(RaceRules, name)}
    if job.standing_laps:
        layout["standing_laps"] = True
    return layout


def _worn(vehicle: Vehicle | None) -> dict[str, Any]:
    """The vehicle's columns of a job."""
    if vehicle is None:
        return {
            "sensors": default_sensors(),
            "lidar_config": {},
            "neural_network": NeuralNetwork.SHALLOW,
            "shell": Shell.PADDOCK,
            "colour": DEFAULT_COLOUR,
        }
    return {name: getattr(vehicle, name) for name in ("sensors", "lidar_config", "neural_network", "shell", "colour")}


def _check_sensors(job: TrainingJob) -> None:
    """A vehicle's sensors are checked when it is made; this one may have been made by hand."""
    unknown = [sensor for sensor in job.sensors if sensor not in SENSOR_NAMES]
    if unknown:
        raise UserFault("metadata_sensor", sensor=str(unknown[0])[:40])
    if sum(sensor in CAMERAS for sensor in job.sensors) != 1 or sum(sensor in LIDARS for sensor in job.sensors) > 1:
        raise UserFault("metadata_sensor_set")


def _check_race(job: TrainingJob, race: Race, now: datetime) -> None:
    """Whether the race would take the model today; whatever else may have changed when it is sent is said then."""
    require_open(race, now)
    missing = not_offered(job.sensors, race.sensors)
    if missing:
        raise UserFault("sensors_not_offered", needed=", ".join(missing), offered=", ".join(race.sensors))
    check_eligible(race, job.owner, now)
    check_terms(race, job.owner)


def _check_evaluation(job: TrainingJob, track: Track) -> None:
    """Whether the model can be tried on this track as it is trained on its own."""
    from .evaluate import options_of_a_test  # which knows how a layout is told from here

    try:
        own_rules(track, options_of_a_test(job))
    except UserFault as fault:
        raise UserFault("training_evaluate_on", track=track.name, problem=str(fault)) from None


def _check_clone(job: TrainingJob, model: TrainedModel) -> None:
    if not can_clone_model(job.owner, model):
        raise UserFault("clone_not_yours")
    has, wanted = model.metadata, job.metadata
    if has.get("frame_stack", 1) > 1:
        raise UserFault("clone_frame_stack", count=has["frame_stack"])
    if sorted(has["sensor"]) != sorted(wanted["sensor"]) or (
        "DISCRETIZED_SECTOR_LIDAR" in has["sensor"]
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
