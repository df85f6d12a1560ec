"""A first car with one click: no form, all values those that are proposed, and a race to find it in."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from django.contrib.auth import get_user_model
from django.db.models import Exists, OuterRef, Q, QuerySet, Subquery

from evaluation.models import TrainedModel
from paddock.rules.training import TrainingSettings
from races.eligibility import refusal
from races.models import Race, RaceType
from races.selectors.offers import beginners_races
from races.sensors import not_offered
from tracks.models import Direction, Track
from tracks.services import load_catalogue

from ..hyperparameters import DEFAULT_ACTIONS
from ..lessons import QUICK
from ..models import JobState, TrainingJob
from ..models.vehicle import default_sensors
from ..rewards.examples import DEFAULT
from .create import create_training

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

NAME = "first-car"
_LOOKED_AT = 12
_ACTIVE = (JobState.QUEUED, JobState.RUNNING)
MINUTES = 3  # it ends with three clean laps, on two cores after a few seconds


def train_first_car(*, owner: Racer, now: datetime) -> TrainingJob:
    """Train the original car on the oval until it drives three clean laps, and send it to the beginners' race there.

    While such a training waits or runs, it is that one: a second click makes no second car. Without such a race it is
    trained all the same. Raises what :func:`create_training` raises.
    """
    running = first_car_on_its_way(owner)
    if running is not None:
        return running
    track = Track.objects.filter(slug=QUICK["track"]).first()
    if track is None:  # a site whose catalogue was not loaded yet
        track = next(one for one in load_catalogue(now=now) if one.slug == QUICK["track"])
    return create_training(
        owner=owner,
        name=free_name(owner, NAME),
        track=track,
        reward_code=DEFAULT.code,
        settings=TrainingSettings(
            action_space_type="discrete",
            action_space=[dict(action) for action in DEFAULT_ACTIONS],
            stop_minutes=MINUTES,
            stop_clean_laps=int(QUICK["stop_clean_laps"]),
        ),
        submit_to_race=race_of_first_car(owner, now),
        now=now,
    )


def first_car_on_its_way(racer: Racer | AnonymousUser) -> TrainingJob | None:
    """The racer's first car while it waits to be trained or is trained."""
    return _on_their_way(racer.pk).defer("log", "driving").first()


@dataclass(frozen=True)
class Begun:
    """How far a racer has come on the way to a car. ``first``: public id of the training of their first one while it
    waits or runs. ``race``: the name of the race that a first car goes to. ``has_house_cars``: whether this site has
    any, whose weights one could begin with."""

    has_car: bool
    first: str | None
    race: str | None
    has_house_cars: bool


def begun_by(racer: Racer, now: datetime) -> Begun:
    """How far a racer has come on the way to a car: one query."""
    models = TrainedModel.objects.filter(owner=OuterRef("pk"), deleted_at=None)
    first = _on_their_way(OuterRef("pk")).values("public_id")[:1]
    races = _races(racer, now)
    found = (
        get_user_model()
        .objects.filter(pk=racer.pk)
        .values_list(
            Exists(models),
            Subquery(first),
            Subquery(races.values("name")[:1]),
            Subquery(races.values("sensors")[:1]),
            Exists(TrainedModel.objects.filter(owner__is_house=True, deleted_at=None)),
        )
    )
    row: Any = found.get()
    has_car, training, name, sensors, has_house_cars = row
    takes_it = name is not None and not not_offered(default_sensors(), sensors)
    return Begun(has_car, training, name if takes_it else None, has_house_cars)


def _on_their_way(owner: Any) -> QuerySet[TrainingJob]:
    jobs = TrainingJob.objects.filter(owner_id=owner, name__startswith=NAME, cloned_from=None, state__in=_ACTIVE)
    return jobs.order_by("pk")


def race_of_first_car(racer: Racer, now: datetime) -> Race | None:
    """Where a first car goes when it is trained; None if no race takes it."""
    for race in _races(racer, now)[:_LOOKED_AT]:
        if not not_offered(default_sensors(), race.sensors) and refusal(race, racer, now) is None:
            return race
    return None


def _races(racer: Racer, now: datetime) -> QuerySet[Race]:
    return beginners_races(
        racer=racer, track_slug=QUICK["track"], direction=Direction.CCW, race_type=RaceType.TIME_TRIAL, now=now
    )


def free_name(owner: Racer, wanted: str) -> str:
    """``wanted``, or with a number behind it, whichever no model or training of the racer has."""
    mine = Q(owner=owner, name__startswith=wanted)
    used = set(TrainedModel.objects.filter(mine, deleted_at=None).values_list("name", flat=True))
    used |= set(TrainingJob.objects.filter(mine).values_list("name", flat=True))
    names = itertools.chain([wanted], (f"{wanted}-{number}" for number in itertools.count(2)))
    return next(name for name in names if name not in used)
