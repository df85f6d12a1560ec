"""The reasons for which a track is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Track files",
    invalid={
        "track_not_npy": _(
            "Not a track file, or incomplete. Save a NumPy array (.npy) with numpy.save, or a CSV table with the "
            "columns x_m, y_m, w_tr_right_m, w_tr_left_m."
        ),
        "track_pickled": _(
            "The file contains pickled Python objects, which are not accepted. Save a plain float64 "
            "array with numpy.save."
        ),
        "track_shape": _(
            "The track must be a table of six number columns (centre x, y, inner x, y, outer x, y); this is %(shape)s."
        ),
        "track_not_finite": _("Row %(row)s contains NaN or infinity. Every point needs finite coordinates in metres."),
        "track_far_away": _(
            "The track has points more than %(limit_m)s m from the origin. Move it closer, or import it with a "
            "smaller scale; coordinates are in metres."
        ),
        "track_too_few_points": _(
            "The track has only %(points)s distinct points; it needs at least %(limit)s. Sample it more finely."
        ),
        "track_open": _(
            "The track is open: its last point is %(gap_m)s m from its first. For a loop, repeat the "
            "first point at the end. For a point-to-point track, mark it as open."
        ),
        "track_not_open": _(
            "The track is a loop: its last point is only %(gap_m)s m from its first. Import it as a "
            "loop, not as an open track."
        ),
        "track_too_short": _(
            "The track is %(length_m)s m long, shorter than %(limit_m)s m. Coordinates are in metres: import it with a "
            "scale of %(scale)s or more."
        ),
        "track_too_long": _(
            "The track is %(length_m)s m long, longer than %(limit_m)s m. Coordinates are in metres: import it with a "
            "scale of %(scale)s or less."
        ),
        "track_turns_back": _(
            "The centre line turns by %(degrees)s degrees at waypoint %(row)s. Round that corner with more points."
        ),
        "track_self_crossing": _(
            "The centre line crosses itself between waypoints %(row)s and %(other_row)s. A track may not cross itself: "
            "remove one of the crossing parts."
        ),
        "track_too_narrow": _(
            "The road is %(width_m)s m wide at waypoint %(row)s, less than %(limit_m)s m. Move the borders "
            "apart, or import it with a least width."
        ),
        "track_too_wide": _(
            "The borders are %(width_m)s m apart at waypoint %(row)s, more than %(limit_m)s m. Each "
            "row needs a centre point and the two border points beside it; a smaller scale makes the road narrower."
        ),
        "track_borders_cross": _(
            "The %(line)s (waypoint %(row)s) crosses the %(other_line)s (waypoint %(other_row)s). The borders "
            "may cross neither each other nor themselves nor the centre line. Round the bend there, or narrow the road."
        ),
        "track_csv_columns": _(
            "The columns %(columns)s are not those of a centre line. Name them x_m, y_m, w_tr_right_m, w_tr_left_m."
        ),
        "track_csv_row": _(
            "Line %(line)s is not a row of numbers like the others: %(row)s. Correct the line or remove it."
        ),
        "track_csv_widths": _(
            "The table has no widths. Add the columns w_tr_right_m and w_tr_left_m, or import it with a least width."
        ),
        "track_csv_negative": _("Row %(row)s has a negative width. Widths are distances in metres: remove the sign."),
        "track_scale": _("The scale must be a number from %(least)s to %(most)s. 1 leaves the track as it is."),
        "track_least_width": _("The least width must be %(least)s to %(most)s m. Leave it out to keep the widths."),
        "track_borders_apart": _(
            "The borders do not enclose the centre line. One border must lie inside the loop and one outside it."
        ),
    },
    too_large={
        "track_file_too_large": _("The track file is larger than %(limit_mb)s MB. Send fewer points."),
        "track_too_large": _("The track has %(points)s points, more than %(limit)s. Sample it less finely."),
    },
)
