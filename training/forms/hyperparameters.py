"""The hyperparameters of the wizard, by the console's names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault
from training.hyperparameters import (
    DEFAULTS,
    HUBER,
    MEAN_SQUARED_ERROR,
    PPO,
    RANGES,
    SAC,
    check_hyperparameters,
    names_of,
)

BATCH_SIZES = (32, 64, 128, 256, 512)
# What the form shows at first; a field that is left empty means the usual value of the algorithm that is chosen.
HYPERPARAMETERS: dict[str, Any] = {**DEFAULTS[SAC], **DEFAULTS[PPO]}


def _number(name: str, label: Any, help_text: Any) -> forms.Field:
    bounds = RANGES[name]
    kind = forms.IntegerField if bounds.whole else SmallNumberField
    attrs = {"min": _plain(bounds.low), "max": _plain(bounds.high), "step": 1 if bounds.whole else "any"}
    widget = forms.NumberInput(attrs=attrs | _usual(name))
    return kind(label=label, help_text=help_text, required=False, widget=widget)


def _usual(name: str) -> dict[str, str]:
    """The usual value of each algorithm that has one, for the script of the page: it changes what nobody has changed
    when another algorithm is chosen."""
    values = {algorithm: usual[name] for algorithm, usual in DEFAULTS.items() if name in usual}
    return {f"data-{key}": value if isinstance(value, str) else _plain(value) for key, value in values.items()}


def _plain(value: float) -> str:
    return f"{value:.8f}".rstrip("0").rstrip(".") or "0"


def _follow_algorithm(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """What was sent, with the usual values of the chosen algorithm in place of the usual ones of another: without a
    script nothing changes them when another algorithm is chosen. ``usual_of`` names the one whose values were shown."""
    shown, chosen = data.get("usual_of"), data.get("algorithm")
    if shown == chosen or shown not in DEFAULTS or chosen not in DEFAULTS:
        return data
    followed = data.copy()
    for name, usual in DEFAULTS[chosen].items():
        if name in DEFAULTS[shown] and _means(data.get(name), DEFAULTS[shown][name]):
            followed[name] = usual if isinstance(usual, str) else _plain(usual)
    followed["usual_of"] = chosen
    return followed


def _means(typed: Any, value: Any) -> bool:
    try:
        return typed == value or float(typed) == value
    except (TypeError, ValueError):
        return False


class SmallNumberField(forms.FloatField):
    """A number that may be very small, shown without an exponent."""

    def prepare_value(self, value: Any) -> Any:
        return _plain(value) if isinstance(value, int | float) else value


class HyperparametersForm(forms.Form):
    """Empty fields mean the usual value. Whether a value makes sense is the service's to say."""

    # the algorithm whose usual values are shown
    usual_of = forms.CharField(required=False, initial=PPO, widget=forms.HiddenInput)

    batch_size = forms.TypedChoiceField(
        label=_("Batch size"),
        choices=[(size, size) for size in BATCH_SIZES],
        coerce=int,
        required=False,
        widget=forms.Select(attrs=_usual("batch_size")),
        help_text=_("Steps looked at together. Larger batches learn more smoothly and more slowly."),
    )
    num_epochs = _number(
        "num_epochs",
        _("Epochs"),
        _("3 to 10: how often each batch of driving is gone through before it is thrown away."),
    )
    lr = _number(
        "lr",
        _("Learning rate"),
        _("0.00000001 to 0.001: how far each update moves the weights. Too far, and it forgets."),
    )
    beta_entropy = _number(
        "beta_entropy",
        _("Entropy"),
        _("0 to 1: how much it is paid for being undecided. More explores more, and settles later."),
    )
    sac_alpha = _number(
        "sac_alpha",
        _("SAC alpha"),
        _("0 to 1: how much it is paid for being undecided. More explores more, and settles later."),
    )
    discount_factor = _number(
        "discount_factor",
        _("Discount factor"),
        _("0 to 1: what a reward is worth one step later. 0.97 looks about 33 steps, two seconds, ahead."),
    )
    loss_type = forms.ChoiceField(
        label=_("Loss"),
        choices=[(HUBER, _("Huber")), (MEAN_SQUARED_ERROR, _("mean squared error"))],
        required=False,
        widget=forms.Select(attrs=_usual("loss_type")),
        help_text=_("How wrong expectations are counted. Huber takes outliers less to heart."),
    )
    num_episodes_between_training = _number(
        "num_episodes_between_training",
        _("Episodes between updates"),
        _("5 to 100: how much is driven before each update. An episode counts as 100 steps."),
    )

    def __init__(self, data: Mapping[str, Any] | None = None, *args: Any, **kwargs: Any) -> None:
        super().__init__(_follow_algorithm(data) if data else data, *args, **kwargs)

    def hyperparameters(self) -> dict[str, Any]:
        """What was chosen, without what belongs to the other algorithm."""
        said = {name: self.cleaned_data.get(name) for name in names_of(self.cleaned_data["algorithm"])}
        return {name: value for name, value in said.items() if value not in (None, "")}

    def clean(self) -> dict[str, Any]:
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
        """Whether one of them has an error, so that they must be shown."""
        return bool({*HYPERPARAMETERS, "seed"} & set(self.errors)) if self.is_bound else False
