"""Why a request is refused, and a stored file fails."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    "platform",
    {
        "internal_error": _("Internal error. Your model is fine; the run will be repeated."),
        "storage_failed": _(
            "A stored file could not be read or written. Your model is fine; the run will be repeated."
        ),
    },
)

register(
    "Programs",
    "user",
    {
        "unknown_field": _("Unknown field %(field)s. Known fields: %(known)s."),
        "no_fields": _("This operation takes no fields. Send it without a body."),
    },
)
