"""Why a request is refused, and a stored file fails."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    "platform",
    {
        "internal_error": _("Paddock made a mistake. Nothing is wrong with your model; it will be tried again."),
        "storage_failed": _(
            "A stored file could not be read or written. Nothing is wrong with your model; it will be tried again."
        ),
    },
)

register(
    "Programs",
    "user",
    {
        "unknown_field": _("There is no field %(field)s here. The fields are: %(known)s."),
        "no_fields": _("This operation takes no fields: what you sent would be left unread. Send it without a body."),
    },
)
