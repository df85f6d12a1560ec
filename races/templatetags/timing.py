"""What pages show of measured laps."""

from __future__ import annotations

from django import template
from django.utils.translation import gettext as _

from core.times import clock

from ..measured import counted_ms, is_complete
from ..models import LapCorrection, MeasuredLap, Race

register = template.Library()


@register.simple_tag
def counted(race: Race, lap: MeasuredLap) -> int | None:
    """What a lap counts with, in milliseconds; None for one that does not."""
    return counted_ms(race, lap) if is_complete(race, lap) else None


@register.simple_tag
def correction(one: LapCorrection) -> str:
    """What was changed, in words: the old value and the new one of each."""
    said = []
    labels = {"off_tracks": _("Off tracks"), "resets": _("Resets")}
    for name, old in one.before.items():
        new = one.after[name]
        if new == old:
            continue
        if name == "valid":
            said.append(_("made valid") if new else _("made invalid"))
        elif name == "time_ms":
            said.append(f"{clock(old)} → {clock(new)}")
        else:
            said.append(f"{labels[name]} {old} → {new}")
    return ", ".join(said)
