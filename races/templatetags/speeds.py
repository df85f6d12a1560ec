"""Speed commands of live events, as pages say them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django import template
from django.utils.translation import gettext as _

from evaluation.models import Evaluation

register = template.Library()


@register.filter
def speed_log(evaluation: Evaluation) -> list[dict[str, Any]]:
    """The commands that a run was driven with, in the order of their times."""
    return list(evaluation.spec["rules"].get("speed_commands") or ())


@register.filter
def speed_command(one: Mapping[str, Any] | None) -> str:
    """A command in words."""
    if one is None or one["mode"] == "model_speed":
        return _("model speed")
    value = one["value"]
    words = {
        "multiplier": _("%(value)s × the model's speed"),
        "cap": _("at most %(value)s m/s"),
        "absolute": _("%(value)s m/s"),
        "percent_max": _("%(value)s %% of 4 m/s"),
        "offset": _("model's speed plus %(value)s m/s"),
    }
    return words[one["mode"]] % {"value": f"{value:+g}" if one["mode"] == "offset" else f"{value:g}"}
