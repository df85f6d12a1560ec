"""What is wrong with a vehicle of the garage, or with how often something is asked for."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "vehicle_name_taken": _("You have another vehicle named “%(name)s”. Choose another name."),
        "vehicle_limit": _("Your garage has %(limit)s vehicles, as many as it may have. Delete one first."),
        "vehicle_not_yours": _("This vehicle is not in your garage. Choose one of yours."),
        "vehicle_sensors": _("A vehicle has one camera (%(cameras)s) and at most one lidar (%(lidars)s)."),
        "vehicle_lidar": _(
            "Only the sensor %(sensor)s has settings. Add it to the sensors, or leave the settings out."
        ),
        "reward_check_runs": _("One of your reward functions is being checked already. Try again in a few seconds."),
    },
)
