"""The reasons for which a race cannot be set up or driven, or a recorded drive not replayed."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "On the track",
    invalid={
        "non_finite_action": _(
            "The network returned NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
    },
)

register(
    "Recorded drives",
    invalid={
        "trace_not_csv": _("Not a sim-trace. Expected: a UTF-8 text file with comma-separated values."),
        "trace_columns_missing": _(
            "The trace has no column %(columns)s. Its first line must name the columns as the official simulator does."
        ),
        "trace_not_a_number": _("Line %(row)s of the trace: %(column)s is %(value)s, not a finite number."),
        "trace_column_twice": _("The trace has the column %(columns)s twice. Leave one of the two."),
        "trace_number_too_large": _(
            "Line %(row)s of the trace: %(column)s is %(value)s, beyond the limit of %(limit)s."
        ),
        "trace_out_of_order": _("Line %(row)s of the trace is older than the line before. Sort the rows by time."),
        "trace_too_short": _("The trace cannot be replayed: no car drives for %(needed_s)s s after its first rows."),
    },
    too_large={
        "trace_too_large": _("The trace is larger than %(limit_mb)s MB. Send fewer episodes."),
    },
)

register(
    "Races",
    invalid={
        # boxes and bots that a track has no room for
        "track_needs_loop": _(
            "Several cars or bots need a loop, and this is a point-to-point track. Choose another "
            "track, a time trial or object avoidance."
        ),
        "track_start_fixed": _("On a point-to-point track laps begin at the start. Set the start to 0."),
        "box_on_start_line": _("Box %(number)s is on the finish line. Move it at least %(least_m)s m away."),
        "boxes_overlap": _(
            "Boxes %(number)s and %(other)s block the track. Place boxes at least %(least_m)s m apart along the track."
        ),
        "box_off_track": _(
            "Box %(number)s blocks the road, which is only %(width_m)s m wide there. Move it to a wider place."
        ),
        "boxes_do_not_fit": _(
            "%(boxes)s boxes at least %(distance_m)s m apart do not fit on this track of "
            "%(length_m)s m. Choose fewer boxes or a smaller distance."
        ),
        "bots_do_not_fit": _(
            "%(bots)s bots at least %(least_m)s m apart do not fit on this track of %(length_m)s m. "
            "Choose fewer bots or a longer track."
        ),
        "variation_not_placed": _(
            "Variation %(number)s does not fit on %(track)s: the road is only %(width_m)s m wide at "
            "%(start_m)s m. Choose a wider track, or another seed."
        ),
    },
)
