"""Personal data of videos: those in which the racer's car drives are deleted, with names in their pictures."""

from core.personal_data.rules import PersonalData, register

from .models import Video

register(
    "videos",
    PersonalData(
        Video,
        owner="asked_by",
        erased="asked_by",
        kept={"A video of other cars, which no part of names the racer.": "segments file poster"}
        | {"A note for operators.": "reason_params operator_detail"},
        section="videos",
        exported="segments",
        withheld={
            "The page of the run offers the file.": "file poster",
            "A note for operators.": "reason_params operator_detail",
        },
    ),
)
