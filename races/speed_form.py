"""The form of a speed command."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from paddock.rules.speed import FASTEST_MPS, VALUES

_LABELS = {
    "multiplier": _("Factor on the model's speed"),
    "cap": _("At most, in m/s"),
    "absolute": _("Always, in m/s"),
    "percent_max": _("Per cent of 4 m/s"),
    "offset": _("More or less, in m/s"),
    "model_speed": _("Model speed"),
}


def modes() -> list[dict[str, Any]]:
    """Each mode with its label and the range of its value, for the page's slider."""
    return [{"name": name, "label": label, "range": VALUES[name]} for name, label in _LABELS.items()]


class SpeedForm(forms.Form):
    """How, how much, and from when."""

    mode = forms.ChoiceField(label=_("How"), choices=list(_LABELS.items()), initial="multiplier")
    value = forms.FloatField(
        label=_("How much"),
        initial=1,
        required=False,
        min_value=-FASTEST_MPS,
        max_value=100,
        widget=forms.NumberInput(attrs={"step": "any", "inputmode": "decimal"}),
    )
    when = forms.ChoiceField(choices=[("now", ""), ("start", "")])
