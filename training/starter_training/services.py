"""A first car with one click: proposed values, no form, a race to submit to."""

import itertools
from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.contrib.auth import get_user_model
from django.db.models import Exists, OuterRef, Q, QuerySet, Subquery, Value
from django.db.models.functions import Coalesce

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import TrainedModel
from paddock.rules.training import TrainingSettings
from races.entries.eligibility import refusal
from races.entries.selectors.offers import beginners_races, gone_from
from races.models import Race, RaceType
from races.models.sensors import not_offered
from tracks.models import Direction, Track
from tracks.services import load_catalogue

from ..jobs.services.creation import create_training
from ..jobs.settings_checks import DEFAULT_ACTIONS
from ..lessons.catalogue import QUICK
from ..models import TrainingJob
from ..models.choices import UNDER_WAY
from ..models.vehicle import default_sensors
from ..rewards.examples import DEFAULT

NAME = "first-car"
_LOOKED_AT = 12
MINUTES = 3  # it ends with three clean laps, on two cores after a few seconds


def train_first_car(*, owner: Racer, now: datetime) -> TrainingJob:
    """Train the original car on the oval until three clean laps, and submit it to the beginners' race there, if any.

    Returns the training under way, if there is one: a second click trains no second car. Raises as
    :func:`create_training`.
    """
    running = _on_their_way(owner.pk).defer("log", "driving").first()
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


@dataclass(frozen=True)
class Begun:
    """A racer's way to a car. ``first``: public id of the first car's training while it waits or runs. ``race``: the
    name of its race, for a racer without both."""

    has_car: bool
    first: str | None
    race: str | None


def begun_by(racer: Racer, now: datetime) -> Begun:
    """One query."""
    rows = _begun(racer=racer.pk, now=now)
    has_car, training, gone = any(row[0] for row in rows), max(row[1] for row in rows), {row[2] for row in rows}
    name = None if has_car or training else _name_of_race(racer, gone, now)
    return Begun(has_car, training or None, name)


def _begun_rows(racer: Any, now: Any) -> QuerySet[Any, Any]:
    """Whether the racer has a car, and the training of the first one; then the races that take no further car."""
    models = TrainedModel.objects.filter(owner=OuterRef("pk"), deleted_at=None)
    first = Coalesce(Subquery(_on_their_way(OuterRef("pk")).values("public_id")[:1]), Value(""))
    begun = get_user_model().objects.filter(pk=racer).order_by().values_list(Exists(models), first, Value(0))
    gone = gone_from(racer).filter(race__closes_at__gt=now).order_by()
    return begun.union(gone.values_list(Value(False), Value(""), "race"), all=True)


_begun = KeptQuery(_begun_rows)


def _name_of_race(racer: Racer, gone: Collection[int], now: datetime) -> str | None:
    """The race of :func:`race_of_first_car`, if the first one takes the car: one query for all racers."""
    races = shared_value(("races of a first car",), lambda: list(_races(None, now)[:_LOOKED_AT]))
    if hasattr(racer, "learner"):
        return None
    race = next((race for race in races if race.pk not in gone), None)
    return None if race is None or not_offered(default_sensors(), race.sensors) else race.name


def _on_their_way(owner: Any) -> QuerySet[TrainingJob]:
    jobs = TrainingJob.objects.filter(owner_id=owner, name__startswith=NAME, cloned_from=None, state__in=UNDER_WAY)
    return jobs.order_by("pk")


def race_of_first_car(racer: Racer, now: datetime) -> Race | None:
    for race in _races(racer, now)[:_LOOKED_AT]:
        if not not_offered(default_sensors(), race.sensors) and refusal(race, racer, now) is None:
            return race
    return None


def _races(racer: Racer | None, now: datetime) -> QuerySet[Race]:
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
