"""Why a recorded drive cannot be replayed."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "trace_too_large": _("The trace is larger than %(limit_mb)s MB. Send fewer episodes."),
        "trace_not_csv": _("This is no sim-trace: a text file (UTF-8) of comma-separated values is needed."),
        "trace_columns_missing": _(
            "The trace has no column %(columns)s. Its first line must name the columns as the official simulator does."
        ),
        "trace_not_a_number": _("Line %(row)s of the trace holds %(value)s for %(column)s, which is no finite number."),
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
