"""What pages show of trainings and vehicles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlencode

from django import template
from django.db.models import Q
from django.middleware.csrf import get_token
from django.template import Context
from django.utils import timezone
from django.utils.translation import gettext as _

from evaluation.models import TrainedModel
from evaluation.selectors import can_see_model
from evaluation.templatetags.garage import sensor_name
from paddock.rules.hyperparameters import HYPERPARAMETERS
from paddock.rules.training import SETTINGS
from races.models import Race, RaceType
from races.sensors import not_offered
from training.cloning import build_of_model
from training.forms.hyperparameters import LOSS_NAMES
from training.models import NeuralNetwork, TrainingJob
from training.selectors import house_cars
from training.services import begun_by
from training.views.common import closed_because

register = template.Library()


@dataclass(frozen=True)
class Origin:
    """The model whose weights another began with. ``is_visible``: the reader may open its page; ``is_named``: they may
    know its name, as they trained from it. ``by``: its racer where it is another's and may be told, else ``""``."""

    model: TrainedModel
    is_visible: bool
    is_named: bool
    by: str


@register.simple_tag(takes_context=True)
def origin_of(context: Context, model: TrainedModel) -> Origin | None:
    """What a model was cloned from; None for one that was not, or came from elsewhere."""
    made = TrainingJob.objects.filter(Q(best_model=model) | Q(last_model=model)).exclude(cloned_from=None)
    job = made.select_related("cloned_from__owner").order_by("pk").first()
    if job is None or job.cloned_from is None:
        return None
    reader, origin = context["user"], job.cloned_from
    visible = can_see_model(reader, origin)
    named = visible or reader.pk == job.owner_id
    another_s = named and origin.owner_id != reader.pk
    return Origin(origin, visible, named, origin.owner.alias if another_s else "")


@register.inclusion_tag("training/parts/ways.html", takes_context=True)
def ways_to_a_car(context: Context, race: Race | None = None, *, but: str = "") -> dict[str, Any]:
    """The three ways to a car: upload one, train one, begin with a house car's weights; for ``race`` where one is asked
    for there. ``but``: a way that the page itself is (``upload``, ``train``).

    Who has no car yet trains the first one by one click, or is led to it while it is being trained.
    """
    request, user = context["request"], context["user"]
    begun = begun_by(user, timezone.now())
    house = house_cars() if begun.has_house_cars else ()
    return {
        "race": race,
        "but": but,
        "closed": closed_because(),
        "first": begun.first,
        "first_race": begun.race,
        "has_car": begun.has_car,
        "house_cars": [model for model in house if race is None or not not_offered(model.sensors, race.sensors)],
        "layout": layout_query(race),
        "csrf_token": get_token(request),
    }


@register.filter
def layout_query(race: Race | None) -> str:
    """What the wizard is asked for so that it trains for ``race``, as the query of its address."""
    if race is None:
        return ""
    asked: dict[str, Any] = {"track": race.track.slug, "direction": race.direction, "submit_to_race": race.slug}
    if race.race_type == RaceType.OBJECT_AVOIDANCE:
        asked |= {"race_type": race.race_type, "random_boxes": race.random_boxes or len(race.boxes)}
    elif race.bots:
        asked |= {"race_type": race.race_type, "bots": race.bots}
    return urlencode(asked)


@register.filter
def network_word(name: str) -> str:
    """The depth of a network in the reader's language; the field's own name where there is none."""
    return str(NeuralNetwork(name).label) if name in NeuralNetwork.values else name


@register.filter
def trains_on(model: TrainedModel) -> bool:
    """Whether the model's weights can be learned on here."""
    return build_of_model(model) is not None


@register.simple_tag
def training_of(model: TrainedModel) -> TrainingJob | None:
    """The training that made a model; None for an uploaded one."""
    return TrainingJob.objects.filter(Q(best_model=model) | Q(last_model=model)).defer("log", "driving").first()


@register.filter
def sensor_words(sensors: list[str]) -> str:
    """Names of sensors in the reader's language."""
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
    """A measured number with so many decimals; a dash for none."""
    return "–" if value is None or value == "" else f"{value:,.{digits}f}"


@register.filter
def item_of(key: str, mapping: dict) -> object:
    """``mapping[key]``, or nothing."""
    return mapping.get(key)


@register.filter
def hyperparameter_name(name: str) -> str:
    """A hyperparameter's name in the reader's language."""
    return _(HYPERPARAMETERS[name].label) if name in HYPERPARAMETERS else name


@register.filter
def setting_name(name: str) -> str:
    """A setting's name in the reader's language."""
    return _(SETTINGS[name].label) if name in SETTINGS else name


@register.filter
def plain_value(value: object) -> str:
    """A hyperparameter's value: small numbers without an exponent, words in the reader's language."""
    if isinstance(value, float):
        return f"{value:.8f}".rstrip("0").rstrip(".")
    return str(LOSS_NAMES.get(str(value), value))
