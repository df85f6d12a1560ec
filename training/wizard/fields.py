"""Form fields of a training: the action table, switches with a strength, the model to start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from operator import itemgetter
from typing import Any

from django import forms
from django.db.models import QuerySet, Value
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.utils.translation import gettext_lazy as _lazy

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from evaluation.models import TrainedModel
from evaluation.selectors import garage_of, newest_shared, visible_model, visible_models
from paddock.rules.rule import Rule
from races.web.names import named, names_track
from training.jobs.settings_checks import ACTION_COUNTS
from training.models import TrainingJob, Vehicle

MOST = ACTION_COUNTS[1]
SPARE_ROWS = 3


class ActionsInput(forms.Widget):
    """A row for each action: steering and speed. Rows without a steering angle are no actions."""

    template_name = "training/wizard/widgets/actions.html"
    use_fieldset = True

    def id_for_label(self, id_: str) -> str:
        return ""

    def get_context(self, name: str, value: Any, attrs: dict[str, object] | None) -> dict[str, object]:
        context = super().get_context(name, None, attrs)
        rows = [_typed(action) for action in value or ()]
        context["widget"] |= {"rows": [*rows, *[("", "")] * (MOST - len(rows))], "shown": len(rows) + SPARE_ROWS}
        return context

    def value_from_datadict(self, data: Mapping[str, Any], files: Any, name: str) -> list[tuple[str, str]]:
        rows = [
            (
                str(data.get(f"{name}-{number}-steering", "")).strip(),
                str(data.get(f"{name}-{number}-speed", "")).strip(),
            )
            for number in range(1, MOST + 1)
        ]
        return [row for row in rows if any(row)]

    def value_omitted_from_data(self, data: Mapping[str, Any], files: Any, name: str) -> bool:
        return not any(f"{name}-{number}-steering" in data for number in range(1, MOST + 1))


class ActionsField(forms.Field):
    widget = ActionsInput

    def to_python(self, value: Any) -> list[dict[str, float]]:
        """Rows as typed, as actions; actions as they are. Raises ValidationError "action_row"."""
        return [row if isinstance(row, dict) else _action(number, *row) for number, row in enumerate(value or (), 1)]


def _action(number: int, steering: str, speed: str) -> dict[str, float]:
    try:
        return {"steering_angle": float(steering.replace(",", ".")), "speed": float(speed.replace(",", "."))}
    except ValueError:
        message = _("Action %(number)s needs a steering angle and a speed, both numbers.") % {"number": number}
        raise forms.ValidationError(message, code="action_row") from None


def _typed(action: Any) -> tuple[str, str]:
    if isinstance(action, dict):
        return f"{action['steering_angle']:g}", f"{action['speed']:g}"
    return tuple(action)


class StrengthInput(forms.NumberInput):
    """A tick, and beside it how strong: percent. Not ticked is 0."""

    template_name = "training/wizard/widgets/strength.html"

    def get_context(self, name: str, value: Any, attrs: dict[str, object] | None) -> dict[str, object]:
        ticked = str(value or 0) != "0"
        context = super().get_context(name, value if ticked else USUAL_STRENGTH, attrs)
        context["widget"]["ticked"] = ticked
        return context

    def value_from_datadict(self, data: Mapping[str, Any], files: Any, name: str) -> Any:
        return super().value_from_datadict(data, files, name) if f"{name}-on" in data else 0

    def value_omitted_from_data(self, data: Mapping[str, Any], files: Any, name: str) -> bool:
        return False


USUAL_STRENGTH = 50


def strength_field(rule: Rule) -> forms.IntegerField:
    most = int(rule.most or 0)
    widget = StrengthInput(attrs={"min": 1, "max": most, "step": 1})
    return forms.IntegerField(
        label=_lazy(rule.label), help_text=_lazy(rule.help), min_value=0, max_value=most, required=False, widget=widget
    )


OWN_LISTED = 100
REWARDS_LISTED = 8
SHARED_LISTED = 30
MODEL, TRAINING = "model", "training"
# MODEL, public id, name and nothing; or TRAINING, public id, name and reward function
OwnRow = tuple[str, str, str, str, datetime]


def _own(racer: Any) -> QuerySet[Any, OwnRow]:
    in_order = "-created_at", "-pk"
    models = garage_of(racer).order_by(*in_order).values("pk")[:OWN_LISTED]
    jobs = TrainingJob.objects.filter(owner_id=racer, deleted_at=None, trial=None).order_by(*in_order).values("pk")
    rows = TrainedModel.objects.filter(pk__in=models).order_by()
    others = TrainingJob.objects.filter(pk__in=jobs[:REWARDS_LISTED]).order_by()
    return rows.values_list(Value(MODEL), "public_id", "name", Value(""), "created_at").union(
        others.values_list(Value(TRAINING), "public_id", "name", "reward_code", "created_at"), all=True
    )


_rows: KeptQuery[OwnRow] = KeptQuery(_own)
_vehicles = KeptQuery(lambda racer: Vehicle.objects.filter(owner_id=racer))


@dataclass
class OwnRows:
    """What the fields of the wizard offer of the racer's own: read once a request."""

    racer: Racer

    @cached_property
    def vehicles(self) -> list[Vehicle]:
        return _vehicles(racer=self.racer.pk)

    @cached_property
    def rows(self) -> list[OwnRow]:
        """The newest models and reward functions, the latest first."""
        return sorted(_rows(racer=self.racer.pk), key=itemgetter(4), reverse=True)


class _Groups(forms.models.ModelChoiceIterator):
    """The choices: nothing, the racer's newest models, the latest shared ones, and the one that is chosen."""

    field: CloneField

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        field = self.field
        yield "", field.empty_label
        if field.owner is None or field.own is None:
            return
        own = [(public_id, name) for kind, public_id, name, *_code in field.own.rows if kind == MODEL]
        others = [(one.public_id, field.label_from_instance(one)) for one in newest_shared(field.owner, SHARED_LISTED)]
        if field.chosen and field.chosen not in dict([*own, *others]):
            chosen = visible_model(field.owner, field.chosen)
            if chosen is not None:
                listed = (chosen.public_id, field.label_from_instance(chosen))
                own, others = ([*own, listed], others) if chosen.owner == field.owner else (own, [*others, listed])
        for title, models in ((_("My models"), own), (_("Shared models"), others)):
            if models:
                yield title, list(models)


class CloneField(forms.ModelChoiceField):
    iterator = _Groups

    def __init__(self, **kwargs: Any) -> None:
        self.owner: Racer | None = None
        self.own: OwnRows | None = None
        self.chosen = ""
        super().__init__(
            queryset=TrainedModel.objects.none(),
            to_field_name="public_id",
            empty_label=gettext_lazy("choose a model"),
            required=False,
            error_messages={
                "invalid_choice": gettext_lazy(
                    "This model cannot be cloned: it is neither yours nor shared. Choose one of yours or a shared one."
                )
            },
            **kwargs,
        )

    def offer(self, own: OwnRows, chosen: Any) -> None:
        self.own, self.owner, self.chosen = own, own.racer, str(chosen or "").replace("\x00", "")[:12]

    def to_python(self, value: Any) -> TrainedModel | None:
        """Choose among all models that the racer sees, not those alone that are offered."""
        if self.owner is not None:
            self.queryset = visible_models(self.owner)
        return super().to_python(value)

    def label_from_instance(self, model: TrainedModel) -> str:
        if self.owner is not None and model.owner_id == self.owner.pk:
            return model.name
        return f"{model.name} ({model.owner.alias})"


class _Offered(forms.models.ModelChoiceIterator):
    field: OfferedField

    def __iter__(self) -> Iterator[tuple[Any, Any]]:
        yield "", self.field.empty_label
        yield from map(self.choice, self.field.offered)


class OfferedField(forms.ModelChoiceField):
    """One of the rows that the form has read."""

    iterator = _Offered
    offered: Sequence[Any] = ()

    def to_python(self, value: Any) -> Any:
        if value in self.empty_values:
            return None
        for one in self.offered:
            if value in (getattr(one, str(self.to_field_name)), one):
                return one
        raise forms.ValidationError(self.error_messages["invalid_choice"], "invalid_choice", {"value": value})

    def label_from_instance(self, row: Any) -> str:
        return row.name


class RaceField(OfferedField):
    def label_from_instance(self, race: Any) -> str:
        name = named(race.name)
        return name if names_track(race.name, race.track.name) else f"{name} · {race.track.name}"


class RaceSelect(forms.Select):
    """Races, each with where it drives: the script of the page puts those first that are like the training."""

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, object]:
        """As Django's, with ``data-drives``: track, race type and direction."""
        option = super().create_option(name, value, *args, **kwargs)
        race = getattr(value, "instance", None)
        if race is not None:
            option["attrs"]["data-drives"] = f"{race.track.slug} {race.race_type} {race.direction}"
        return option
