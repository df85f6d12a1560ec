"""Form fields of a training: the action table, switches with a strength, the model to start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from django import forms
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.utils.translation import gettext_lazy as _lazy

from accounts.models import Racer
from evaluation.models import TrainedModel
from evaluation.selectors import models_of, newest_shared, visible_models
from paddock.rules.rule import Rule
from races.models import Race
from races.web.names import named, names_track
from training.jobs.settings_checks import ACTION_COUNTS

MOST = ACTION_COUNTS[1]
SPARE_ROWS = 3


class ActionsInput(forms.Widget):
    """A row for each action: steering and speed. Rows without a steering angle are no actions."""

    template_name = "training/wizard/widgets/actions.html"
    use_fieldset = True

    def id_for_label(self, id_: str) -> str:
        return ""

    def get_context(self, name: str, value: Any, attrs: dict[str, Any] | None) -> dict[str, Any]:
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

    def get_context(self, name: str, value: Any, attrs: dict[str, Any] | None) -> dict[str, Any]:
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
SHARED_LISTED = 30


class _Groups(forms.models.ModelChoiceIterator):
    """The choices: nothing, the racer's newest models, the latest shared ones, and the one that is chosen."""

    field: CloneField

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        field = self.field
        yield "", field.empty_label
        if field.owner is None:
            return
        own = list(models_of(field.owner).order_by("-created_at", "-pk")[:OWN_LISTED])
        others = newest_shared(field.owner, SHARED_LISTED)
        chosen = self._chosen_beside(own + others)
        if chosen is not None:
            (own if chosen.owner_id == field.owner.pk else others).append(chosen)
        for title, models in ((_("My models"), own), (_("Shared models"), others)):
            if models:
                yield title, [self.choice(model) for model in models]

    def _chosen_beside(self, listed: list[TrainedModel]) -> TrainedModel | None:
        chosen = self.field.chosen
        if not chosen or any(model.public_id == chosen for model in listed):
            return None
        return self.queryset.filter(public_id=chosen).first()


class CloneField(forms.ModelChoiceField):
    iterator = _Groups

    def __init__(self, **kwargs: Any) -> None:
        self.owner: Racer | None = None
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

    def offer(self, owner: Racer, chosen: Any) -> None:
        self.owner, self.chosen = owner, str(chosen or "").replace("\x00", "")[:12]
        self.queryset = visible_models(owner)

    def label_from_instance(self, model: TrainedModel) -> str:
        if self.owner is not None and model.owner_id == self.owner.pk:
            return model.name
        return f"{model.name} ({model.owner.alias})"


class _RaceChoices(forms.models.ModelChoiceIterator):
    field: RaceField

    def __iter__(self) -> Iterator[tuple[Any, Any]]:
        yield "", self.field.empty_label
        yield from map(self.choice, self.field.offered)


class RaceField(forms.ModelChoiceField):
    """One of the races that the form has read, by its address."""

    iterator = _RaceChoices
    offered: Sequence[Race] = ()

    def to_python(self, value: Any) -> Race | None:
        if value in self.empty_values:
            return None
        for race in self.offered:
            if value in (race.slug, race):
                return race
        raise forms.ValidationError(self.error_messages["invalid_choice"], "invalid_choice", {"value": value})

    def label_from_instance(self, race: Any) -> str:
        name = named(race.name)
        return name if names_track(race.name, race.track.name) else f"{name} · {race.track.name}"


class RaceSelect(forms.Select):
    """Races, each with where it drives: the script of the page puts those first that are like the training."""

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """As Django's, with ``data-drives``: track, race type and direction."""
        option = super().create_option(name, value, *args, **kwargs)
        race = getattr(value, "instance", None)
        if race is not None:
            option["attrs"]["data-drives"] = f"{race.track.slug} {race.race_type} {race.direction}"
        return option
