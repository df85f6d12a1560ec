"""Why a track is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Track files",
    "user",
    {
        "track_not_npy": _(
            "This is not a NumPy array file (.npy), or it is cut short. Save the track with numpy.save."
        ),
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
            "The track is open: its last point is %(gap_m)s m from its first. For a loop, repeat the first point at "
            "the end; if it is to be driven from start to end, say that it is open."
        ),
        "track_not_open": _(
            "The track is a loop: its last point is %(gap_m)s m from its first, no farther than its points lie apart. "
            "Import it without saying that it is open."
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
