"""The reasons for which a video is refused or fails."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Videos",
    invalid={
        "video_no_car": _(
            "A video follows one of the run's cars, of which there are one to %(most)s. There is no car %(number)s."
        ),
        "video_lap_unknown": _("The car that the video follows has %(laps)s laps. There is no lap %(lap)s."),
        "video_too_long": _(
            "This run lasts %(seconds)s seconds; a video shows %(limit)s at most. Make a video of one of its laps."
        ),
        "video_part": _(
            "“%(part)s” is not a part of a run. Choose “whole”, “best” (the car's fastest lap) or the number of a lap."
        ),
        "video_language": _("Videos have their words in one of the languages %(known)s, not in “%(language)s”."),
        "video_moment": _(
            "A clip begins and ends within the run of %(seconds)s seconds, and lasts at least %(least)s s. Choose "
            "other times."
        ),
        "video_moment_order": _("The end of the clip must come after its beginning. Choose a later end."),
        "video_camera": _("There is no camera “%(camera)s”. Choose one of these: %(known)s."),
        "video_format": _("There is no format “%(format)s”. Choose one of these: %(known)s."),
        "video_animation_too_long": _("A WebP lasts %(limit)s seconds at most. Choose a shorter moment, or MP4."),
        "video_stopped": _("The video was stopped before it was done. Ask for it again to have it."),
    },
    conflict={
        "video_no_steps": _("The car in this video did not drive, so there is nothing to show."),
        "video_run_not_finished": _("This run has no result yet, so it has no video. Wait until it ends."),
        "video_no_best_lap": _("Car %(car)s has no complete lap. Choose the whole run."),
        "videos_off": _("Videos are switched off on this site."),
        "videos_at_once": _("You have %(limit)s videos in progress, the maximum. Wait for one, or stop one."),
        "videos_a_day": _("You requested %(limit)s videos in a day, the maximum. Request this one tomorrow."),
    },
    unavailable={
        "video_encoder_missing": _(
            "The video worker cannot encode videos (%(detail)s). “manage.py doctor” shows the operator what is missing."
        ),
        "video_file_lost": _("The file of this video was deleted. Request the video again."),
        "video_gave_up": _("Paddock failed to make this video %(attempts)s times. Ask for it again later."),
    },
)

register(
    "Several cars in a race",
    invalid={
        "car_number": _("There is no car %(car)s in this evaluation. Ask for one of these numbers: %(known)s."),
    },
)
