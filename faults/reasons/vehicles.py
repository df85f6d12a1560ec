"""What is wrong with a vehicle of the garage, or with how often something is asked for."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "vehicle_name_taken": _("You have another vehicle named “%(name)s”. Choose another name."),
        "vehicle_limit": _("Your garage has %(limit)s vehicles, as many as it may have. Delete one first."),
        "vehicle_not_yours": _("This vehicle is not in your garage. Choose one of yours."),
        "reward_check_runs": _("One of your reward functions is being checked already. Try again in a few seconds."),
    },
)
