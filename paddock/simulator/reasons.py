"""Why a race cannot be laid out or driven, and a recorded drive not replayed."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "On the track",
    "user",
    {
        "non_finite_action": _(
            "The network answered NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
    },
)

register(
    "Recorded drives",
    "user",
    {
        "trace_too_large": _("The trace is larger than %(limit_mb)s MB. Send fewer episodes."),
        "trace_not_csv": _("This is not a sim-trace: a text file (UTF-8) of comma-separated values is needed."),
        "trace_columns_missing": _(
            "The trace has no column %(columns)s. Its first line must name the columns as the official simulator does."
        ),
        "trace_not_a_number": _(
            "Line %(row)s of the trace holds %(value)s for %(column)s, which is not a finite number."
        ),
        "trace_column_twice": _("The trace has the column %(columns)s twice. Leave one of the two."),
        "trace_number_too_large": _(
            "Line %(row)s of the trace holds %(value)s for %(column)s. No recorded drive has a figure beyond %(limit)s."
        ),
        "trace_out_of_order": _(
            "Line %(row)s of the trace is older than the line before it. Rows must follow each other in time."
        ),
        "trace_too_short": _(
            "Nothing in the trace can be replayed: no car in it drives on for %(needed_s)s s after its first rows."
        ),
    },
)

register(
    "Races",
    "user",
    {
        # boxes and bots that a track has no room for
        "track_needs_loop": _(
            "This track is driven from start to end, and several cars or bots need a loop. Choose another track, or a "
            "time trial or object avoidance."
        ),
        "track_start_fixed": _(
            "This track is driven from its start to its end, and laps begin nowhere else. Leave the start at 0."
        ),
        "box_on_start_line": _(
            "Box %(number)s stands on the finish line. Move it at least %(least_m)s m away from it."
        ),
        "boxes_overlap": _(
            "Boxes %(number)s and %(other)s overlap or leave no way between them. Put at least %(least_m)s m of track "
            "between any two."
        ),
        "box_off_track": _(
            "Box %(number)s has no room on the track: the road is %(width_m)s m wide there, and a car could not pass. "
            "Move it to a wider place."
        ),
        "boxes_do_not_fit": _(
            "%(boxes)s boxes at least %(distance_m)s m apart do not fit on this track of %(length_m)s m. Ask for fewer "
            "boxes or a smaller distance."
        ),
        "bots_do_not_fit": _(
            "%(bots)s bots at least %(least_m)s m apart do not fit on this track of %(length_m)s m. Ask for fewer bots "
            "or choose a longer track."
        ),
        "variation_not_placed": _(
            "Variation %(number)s cannot be placed on %(track)s: the road is %(width_m)s m wide at %(start_m)s m, and "
            "the car would not stand on it with all its wheels. Choose a wider track, or another seed."
        ),
    },
)
