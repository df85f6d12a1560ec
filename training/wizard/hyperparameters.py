"""The hyperparameters of the wizard, with the console's names."""

import json
from collections.abc import Iterable
from types import new_class
from typing import Any, TypeAlias

from django import forms
from django.http import QueryDict
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS, LOSS_TYPES, PPO, SAC, Hyperparameter
from training.jobs.settings_checks import check_hyperparameters, names_of

Sent: TypeAlias = QueryDict | dict[str, object]
# What the form shows at first; a field that is left empty means the usual value of the algorithm that is chosen.
SHOWN: dict[str, float | str] = {**DEFAULTS[SAC], **DEFAULTS[PPO]}
LOSS_NAMES = dict(zip(LOSS_TYPES, (_("Huber"), _("mean squared error")), strict=True))


def _field(one: Hyperparameter) -> forms.Field:
    options: dict[str, Any] = {"label": _(one.label), "help_text": _(one.help), "required": False}
    if one.choices:
        choices = [(value, LOSS_NAMES[value]) for value in one.choices]
        return forms.ChoiceField(choices=choices, widget=forms.Select(attrs=_usual(one.name)), **options)
    if one.sizes:
        sizes = [(size, size) for size in one.sizes]
        return forms.TypedChoiceField(choices=sizes, coerce=int, widget=forms.Select(attrs=_usual(one.name)), **options)
    whole = one.type is int
    least = min(one.least or 0, *one.console.values())  # the console's own value is always taken
    attrs = {"min": _plain(least), "max": _plain(one.most or 0), "step": 1 if whole else "any"}
    widget = forms.NumberInput(attrs=attrs | _usual(one.name))
    return (forms.IntegerField if whole else SmallNumberField)(widget=widget, **options)


def _usual(name: str) -> dict[str, str]:
    """Data attributes with each algorithm's default: the page's script changes unchanged values with the algorithm."""
    return {f"data-{algorithm}": _typed(usual[name]) for algorithm, usual in DEFAULTS.items() if name in usual}


def _plain(value: float) -> str:
    return f"{value:.8f}".rstrip("0").rstrip(".") or "0"


def _typed(value: float | str) -> str:
    return value if isinstance(value, str) else _plain(value)


def _follow_algorithm(data: Sent) -> Sent:
    """The sent values, with defaults of another algorithm replaced by those of the chosen one. ``usual_of``: the
    algorithm whose defaults were shown."""
    shown: Any = data.get("usual_of")
    chosen: Any = data.get("algorithm")
    if shown == chosen or shown not in DEFAULTS or chosen not in DEFAULTS:
        return data
    followed = data.copy()
    for name, usual in DEFAULTS[chosen].items():
        if name in DEFAULTS[shown] and _means(data.get(name), DEFAULTS[shown][name]):
            followed[name] = _typed(usual)
    followed["usual_of"] = chosen
    return followed


def _means(typed: Any, value: Any) -> bool:
    try:
        return typed == value or float(typed) == value
    except (TypeError, ValueError):
        return False


# The values that a button fills in, by the button's submitted value and the algorithm.
FILLS: dict[str, dict[str, dict[str, str]]] = {
    "console": {
        algorithm: {name: _typed(HYPERPARAMETERS[name].console[algorithm]) for name in usual}
        for algorithm, usual in DEFAULTS.items()
    },
    "usual": {
        algorithm: {name: _typed(value) for name, value in usual.items()} for algorithm, usual in DEFAULTS.items()
    },
}


class SmallNumberField(forms.FloatField):
    def prepare_value(self, value: Any) -> Any:
        return _plain(value) if isinstance(value, int | float) else value


def shown_value(value: float | str) -> str:
    """Small numbers without an exponent, words in the reader's language."""
    return str(LOSS_NAMES.get(value, value)) if isinstance(value, str) else _plain(value)


def _each(values: Iterable[float | str]) -> str:
    """The value of PPO and that of SAC, one where they are the same."""
    return ", ".join(dict.fromkeys(map(shown_value, values)))


_EACH = {one.name: _field(one) for one in HYPERPARAMETERS.values()}
_ON_PAGE = sorted(HYPERPARAMETERS.values(), key=lambda one: one.place)
_Fields = new_class("Fields", (forms.Form,), exec_body=lambda body: body.update(_EACH))


class HyperparametersForm(_Fields):  # type: ignore[misc, valid-type]
    """Empty fields mean the usual value. The service checks the values."""

    # the algorithm whose usual values are shown
    usual_of = forms.CharField(required=False, initial=PPO, widget=forms.HiddenInput)

    def __init__(self, data: Sent | None = None, *args: Any, **kwargs: Any) -> None:
        super().__init__(_follow_algorithm(data) if data else data, *args, **kwargs)

    def shown_hyperparameters(self) -> list[tuple[str, forms.BoundField]]:
        """The field of each, in the order of the page, with the algorithm that alone has it, "" for both."""
        return [("" if len(one.usual) > 1 else next(iter(one.usual)), self[one.name]) for one in _ON_PAGE]

    def beside_the_console(self) -> list[tuple[str, str, str, str]]:
        """Label, our default, the console's, and why they differ, in the order of the page; texts in English."""
        console = {one.name: _each(one.console[algorithm] for algorithm in one.usual) for one in _ON_PAGE}
        return [(one.label, _each(one.usual.values()), console[one.name], one.why) for one in _ON_PAGE]

    def fills(self) -> list[tuple[str, str, str]]:
        labels = {"console": _("Use AWS console defaults"), "usual": _("Use Paddock defaults")}
        return [(name, str(labels[name]), json.dumps(values)) for name, values in FILLS.items()]

    def hyperparameters(self) -> dict[str, float | str]:
        values = {name: self.cleaned_data.get(name) for name in names_of(self.cleaned_data["algorithm"])}
        return {name: value for name, value in values.items() if value not in (None, "")}

    def clean(self) -> dict[str, object]:
        """Check each one, so that a refusal stands beside its field."""
        cleaned = super().clean()
        algorithm = cleaned.get("algorithm")
        if algorithm:
            names = names_of(algorithm)
            for name in HYPERPARAMETERS:
                if name not in names:
                    self.errors.pop(name, None)
                    cleaned[name] = None
                elif cleaned.get(name) not in (None, ""):
                    try:
                        check_hyperparameters(algorithm, {name: cleaned[name]})
                    except UserFault as fault:
                        add_fault(self, fault, name)
        return cleaned

    def wrong_hyperparameters(self) -> bool:
        return bool({*HYPERPARAMETERS, "seed"} & set(self.errors)) if self.is_bound else False
