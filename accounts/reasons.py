"""Why something about an account is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Account",
    "user",
    {
        "sign_up_invitation": _(
            "The last place of this invitation was just taken, or its time is over. Ask whoever sent it for another."
        ),
        "too_many_tokens": _("You have %(limit)s API tokens already. Revoke one that you no longer need."),
    },
)
