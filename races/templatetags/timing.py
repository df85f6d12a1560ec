"""Template tags for measured laps."""

from django import template
from django.utils.translation import gettext as _

from core.times import clock

from ..boards.counted_laps import counted_time
from ..models import LapCorrection

register = template.Library()
register.simple_tag(counted_time, name="counted")


@register.simple_tag
def correction(one: LapCorrection) -> str:
    """A correction as text: the old and the new value of each change."""
    changes = []
    labels = {"off_tracks": _("Off tracks"), "resets": _("Resets")}
    for name, old in one.before.items():
        new = one.after[name]
        if new == old:
            continue
        if name == "valid":
            changes.append(_("made valid") if new else _("made invalid"))
        elif name == "time_ms":
            changes.append(f"{clock(old)} → {clock(new)}")
        else:
            changes.append(f"{labels[name]} {old} → {new}")
    return ", ".join(changes)
