"""Why the body of a request to the API is refused."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "unknown_field": _("There is no field %(field)s here. The fields are: %(known)s."),
        "no_fields": _("This operation takes no fields: what you sent would be left unread. Send it without a body."),
    },
)
