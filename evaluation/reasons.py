"""Every reason code, whose fault it is, and the sentence a racer reads. No Django here.

The sentence says what is wrong and what to do. ``%(name)s`` placeholders come from the error's params.
``gettext_noop`` only marks the text for translation; pages translate it when they show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


@dataclass(frozen=True)
class Reason:
    """One reason code. ``fault`` is ``"user"`` or ``"platform"``."""

    code: str
    fault: str
    sentence: str

    def render(self, params: dict[str, Any], sentence: str | None = None) -> str:
        """The sentence (or its translation ``sentence``) with ``params`` filled in; a missing one shows as ``?``."""
        return (sentence or self.sentence) % _Params(params)


class _Params(dict):
    def __missing__(self, key: str) -> str:
        return "?"


def _table(fault: str, sentences: dict[str, str]) -> dict[str, Reason]:
    return {code: Reason(code, fault, sentence) for code, sentence in sentences.items()}


_ = gettext_noop

# --- upload ---------------------------------------------------------------------------------------------------------
_UPLOAD = _table("user", {})

# --- metadata -------------------------------------------------------------------------------------------------------
_METADATA = _table("user", {})

# --- conversion -----------------------------------------------------------------------------------------------------
_CONVERSION = _table("user", {})

# --- gate -----------------------------------------------------------------------------------------------------------
_GATE = _table("user", {})

# --- run time -------------------------------------------------------------------------------------------------------
_RUN_TIME = _table(
    "user",
    {
        "non_finite_action": _(
            "The network answered NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
    },
)

# --- platform -------------------------------------------------------------------------------------------------------
_PLATFORM = _table("platform", {})

# --- tracks ---------------------------------------------------------------------------------------------------------
_TRACKS = _table(
    "user",
    {
        "track_not_npy": _("This is no NumPy array file (.npy), or it is cut short. Save the track with numpy.save."),
        "track_pickled": _(
            "The file holds pickled Python objects, which are never opened. Save a plain float64 array with numpy.save."
        ),
        "track_file_too_large": _("The track file is larger than %(limit_mb)s MB. Send fewer points."),
        "track_shape": _(
            "The track must be a table of six number columns (centre x, y, inner x, y, outer x, y); this is %(shape)s."
        ),
        "track_not_finite": _("Row %(row)s holds NaN or infinity. Every point needs real coordinates in metres."),
        "track_far_away": _(
            "The track has points more than %(limit_m)s m from the origin. Move it there; coordinates are in metres."
        ),
        "track_too_few_points": _(
            "The track has only %(points)s distinct points; it needs at least %(limit)s. Sample it more finely."
        ),
        "track_too_large": _("The track has %(points)s points, more than %(limit)s. Sample it less finely."),
        "track_open": _(
            "The track is open: its last point is %(gap_m)s m from its first. A race needs a closed loop; "
            "repeat the first point at the end."
        ),
        "track_too_short": _(
            "The track is %(length_m)s m long, shorter than %(limit_m)s m. Coordinates are in metres: scale it up."
        ),
        "track_too_long": _(
            "The track is %(length_m)s m long, longer than %(limit_m)s m. Coordinates are in metres: scale it down."
        ),
        "track_turns_back": _(
            "The centre line turns by %(degrees)s degrees at waypoint %(row)s. Round that corner with more points."
        ),
        "track_self_crossing": _(
            "The centre line crosses itself between waypoints %(row)s and %(other_row)s. A track may not cross itself."
        ),
        "track_too_narrow": _(
            "The road is %(width_m)s m wide at waypoint %(row)s, less than %(limit_m)s m. Move the borders apart."
        ),
        "track_too_wide": _(
            "The borders are %(width_m)s m apart at waypoint %(row)s, more than %(limit_m)s m. Each row must "
            "hold a centre point and the two border points across the road from it."
        ),
        "track_borders_cross": _(
            "The %(line)s (waypoint %(row)s) crosses the %(other_line)s (waypoint %(other_row)s). The borders "
            "may cross neither each other nor themselves nor the centre line."
        ),
        "track_borders_apart": _(
            "The borders do not enclose the centre line. One border must lie inside the loop and one outside it."
        ),
    },
)

# --- race -----------------------------------------------------------------------------------------------------------
_RACE = _table("user", {})

REASONS: dict[str, Reason] = {
    **_UPLOAD,
    **_METADATA,
    **_CONVERSION,
    **_GATE,
    **_RUN_TIME,
    **_PLATFORM,
    **_TRACKS,
    **_RACE,
}
