"""Limits of an account."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "sign_up_invitation": _(
            "The last place of this invitation was just taken, or its time is over. Ask whoever sent it for another."
        ),
        "too_many_tokens": _("You have %(limit)s API tokens already. Revoke one that you no longer need."),
    },
)
