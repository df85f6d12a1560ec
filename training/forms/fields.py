"""Form fields of a training: the table of actions, ticks with strengths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django import forms
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy as _lazy

from paddock.rules.rule import Rule
from training.hyperparameters import ACTION_COUNTS

MOST = ACTION_COUNTS[1]
SPARE_ROWS = 3


class ActionsInput(forms.Widget):
    """A row for each action: steering and speed. Rows without a steering angle are no actions."""

    template_name = "training/widgets/actions.html"
    use_fieldset = True

    def id_for_label(self, id_: str) -> str:
        """None: the rows have labels of their own."""
        return ""

    def get_context(self, name: str, value: Any, attrs: dict[str, Any] | None) -> dict[str, Any]:
        """As Django's, with ``rows`` of (steering, speed) as typed: those in use, and empty ones."""
        context = super().get_context(name, None, attrs)
        rows = [_typed(action) for action in value or ()]
        context["widget"] |= {"rows": [*rows, *[("", "")] * (MOST - len(rows))], "shown": len(rows) + SPARE_ROWS}
        return context

    def value_from_datadict(self, data: Mapping[str, Any], files: Any, name: str) -> list[tuple[str, str]]:
        """The rows as typed, empty ones left out."""
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
    """Actions, as ``model_metadata.json`` lists them."""

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

    template_name = "training/widgets/strength.html"

    def get_context(self, name: str, value: Any, attrs: dict[str, Any] | None) -> dict[str, Any]:
        """As Django's, with ``ticked`` and the strength that a tick proposes."""
        ticked = str(value or 0) != "0"
        context = super().get_context(name, value if ticked else USUAL_STRENGTH, attrs)
        context["widget"]["ticked"] = ticked
        return context

    def value_from_datadict(self, data: Mapping[str, Any], files: Any, name: str) -> Any:
        """What was typed where it is ticked, else 0."""
        return super().value_from_datadict(data, files, name) if f"{name}-on" in data else 0

    def value_omitted_from_data(self, data: Mapping[str, Any], files: Any, name: str) -> bool:
        return False


USUAL_STRENGTH = 50


def strength_field(rule: Rule) -> forms.IntegerField:
    """The field of one of :data:`paddock.rules.training.RANDOMISED`."""
    most = int(rule.most or 0)
    widget = StrengthInput(attrs={"min": 1, "max": most, "step": 1})
    return forms.IntegerField(
        label=_lazy(rule.label), help_text=_lazy(rule.help), min_value=0, max_value=most, required=False, widget=widget
    )
