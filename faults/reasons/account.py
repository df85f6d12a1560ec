"""Limits of an account."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "too_many_tokens": _("You have %(limit)s API tokens already. Revoke one that you no longer need."),
    },
)
