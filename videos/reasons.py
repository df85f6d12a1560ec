"""Why no video of a run is made."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Videos",
    "user",
    {
        "video_no_car": _(
            "A video follows one of the run's cars, of which there are one to %(most)s. There is no car %(number)s."
        ),
        "video_lap_unknown": _("The car that the video follows has %(laps)s laps. There is no lap %(lap)s."),
        "video_no_steps": _("The car that the video follows did not drive, so there is nothing to show."),
        "video_too_long": _(
            "This run lasts %(seconds)s seconds; a video shows %(limit)s at most. Make a video of one of its laps."
        ),
    },
)
