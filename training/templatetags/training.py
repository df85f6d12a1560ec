"""Template tags of trainings and vehicles."""

import math
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlencode

from django import template
from django.db.models import Q, QuerySet
from django.middleware.csrf import get_token
from django.template import Context
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _

from core.database.kept_queries import KeptQuery
from evaluation.appearance.looks import VehicleLook
from evaluation.models import TrainedModel
from evaluation.selectors import can_see_model
from evaluation.templatetags.garage import sensor_name
from paddock.rules.hyperparameters import HYPERPARAMETERS
from paddock.rules.race import BOX_COUNT
from paddock.rules.training import SETTINGS
from races.models import Race, RaceType
from races.models.sensors import not_offered
from races.replays.document import look_document
from races.replays.setup import viewer_setup
from training.cloning.selectors import build_of_model, house_cars
from training.jobs.selectors import closed_because
from training.models import JobState, NeuralNetwork, TrainingJob
from training.starter_training.services import begun_by
from training.wizard.hyperparameters import shown_value

register = template.Library()
STEP_MS = 1000 / 15  # of an evaluation, from one place to the next
register.filter("plain_value", shown_value)


@dataclass(frozen=True)
class Origin:
    """The model whose weights another began with. ``is_visible``: the reader may open its page; ``is_named``: may see
    its name. ``by``: its racer if it is another's and may be shown, else ``""``."""

    model: TrainedModel
    is_visible: bool
    is_named: bool
    by: str


@register.simple_tag(takes_context=True)
def origin_of(context: Context, model: TrainedModel) -> Origin | None:
    """What a model was cloned from; None for one that was not, or came from elsewhere."""
    job = min((job for job in _trainings_of(model) if job.cloned_from), key=lambda job: job.pk, default=None)
    if job is None or job.cloned_from is None:
        return None
    reader, origin = context["user"], job.cloned_from
    visible = can_see_model(reader, origin)
    named = visible or reader.pk == job.owner_id
    another_s = named and origin.owner_id != reader.pk
    return Origin(origin, visible, named, origin.owner.alias if another_s else "")


@register.inclusion_tag("training/starter_training/parts/ways.html", takes_context=True)
def ways_to_a_car(context: Context, race: Race | None = None, *, but: str = "") -> dict[str, object]:
    """The ways to a car: upload, train, clone a house car. ``race``: that needs one. ``but``: the page's own way
    (``upload``, ``train``). A racer without a car gets one button that trains the first, or a link to that training."""
    request, user = context["request"], context["user"]
    begun = begun_by(user, timezone.now())
    return {
        "race": race,
        "but": but,
        "closed": closed_because(),
        "first": begun.first,
        "first_race": begun.race,
        "has_car": begun.has_car,
        "house_cars": [model for model in house_cars() if race is None or not not_offered(model.sensors, race.sensors)],
        "layout": layout_query(race),
        "csrf_token": get_token(request),
    }


@register.filter
def layout_query(race: Race | None) -> str:
    if race is None:
        return ""
    asked: dict[str, str | int] = {"track": race.track.slug, "direction": race.direction, "submit_to_race": race.slug}
    if race.race_type == RaceType.OBJECT_AVOIDANCE:
        asked |= {"race_type": race.race_type, BOX_COUNT: race.random_boxes or len(race.boxes)}
    elif race.bots:
        asked |= {"race_type": race.race_type, "bots": race.bots}
    return urlencode(asked)


@register.filter
def network_word(name: str) -> str:
    """The depth of a network in the reader's language; the field's own name where there is none."""
    return str(NeuralNetwork(name).label) if name in NeuralNetwork.values else name


@register.filter
def trains_on(model: TrainedModel) -> bool:
    return build_of_model(model) is not None


@register.simple_tag
def training_of(model: TrainedModel) -> TrainingJob | None:
    return next(iter(_trainings_of(model)), None)


def _jobs_of(model: Any) -> QuerySet[TrainingJob]:
    made = TrainingJob.objects.filter(Q(best_model_id=model) | Q(last_model_id=model))
    return made.defer("log", "driving").select_related("cloned_from__owner")


_made = KeptQuery(_jobs_of)


def _trainings_of(model: TrainedModel) -> list[TrainingJob]:
    """The trainings whose best or last model this is, the latest first; the model keeps them."""
    found: list[TrainingJob] | None = getattr(model, "_trainings", None)
    if found is None:
        found = _made(model=model.pk)
        model._trainings = found  # type: ignore[attr-defined]
    return found


@dataclass(frozen=True)
class RunningTraining:
    """A training that runs, and the setup of a viewer that plays its newest evaluation."""

    job: TrainingJob
    viewer: str


_running = KeptQuery(
    lambda racer: (
        TrainingJob.objects.filter(owner_id=racer, state=JobState.RUNNING, deleted_at=None, trial=None)
        .defer("log", "printed", "seen", "reward_code")
        .select_related("track")
        .order_by("-pk")[:1]
    )
)


@register.simple_tag(takes_context=True)
def running_training(context: Context) -> RunningTraining | None:
    """The reader's newest running training that was evaluated."""
    reader = context["user"]
    job = next(iter(_running(racer=reader.pk)), None) if reader.is_authenticated else None
    if job is None or len(job.driving or ()) < 2:
        return None
    scene = f"{reverse('track_scene', args=[job.track.slug])}?direction={job.direction}"
    return RunningTraining(job, viewer_setup(scene, [{"document": _drive_document(job), "lap": 0}], quiet=True))


def _drive_document(job: TrainingJob) -> dict[str, object]:
    """The newest evaluation as a run document."""
    x, y, yaw, speed = map(list, zip(*job.driving, strict=True))
    steps = len(x)
    return {
        **{"run": "", "number": 0, "name": job.name, "href": job.get_absolute_url()},
        "look": look_document(VehicleLook(job.shell, job.colour)),
        "columns": {
            **{"t": [round(STEP_MS * step) for step in range(steps)], "x": x, "y": y},
            **{"yaw": [round(math.degrees(angle), 1) for angle in yaw], "v": speed, "steer": [0.0] * steps},
            **{"lap": [1] * steps, "status": ["in_progress"] * steps},
            **{"progress": [0.0] * steps, "on_track": [True] * steps},
        },
        **{"laps": [], "rivals": [], "events": [], "boxes": [], "bots": []},
    }


@register.filter
def sensor_words(sensors: list[str]) -> str:
    return ", ".join(sensor_name(sensor) for sensor in sensors)


@register.filter
def span(seconds: float | None) -> str:
    """A time of training as ``m:ss`` (``h:mm:ss`` from an hour on)."""
    whole = max(0, round(seconds or 0))
    hours, rest = divmod(whole, 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes}:{left:02d}"


@register.filter
def figure(value: float | Literal[""] | None, digits: int = 2) -> str:
    return "–" if value is None or value == "" else f"{value:,.{digits}f}"


@register.filter
def hyperparameter_name(name: str) -> str:
    return _(HYPERPARAMETERS[name].label) if name in HYPERPARAMETERS else name


@register.filter
def setting_name(name: str) -> str:
    return _(SETTINGS[name].label) if name in SETTINGS else name
