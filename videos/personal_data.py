"""Personal data of videos: those in which the racer's car drives are deleted, with names in their pictures."""

from django.db.models import Sum

from core.personal_data.retention import RetentionPolicy
from core.personal_data.rules import Leaving, PersonalData, register
from evaluation.models import TrainedModel

from .models import Video
from .selectors import videos_to_purge
from .services.stored_files import purge_videos, remove_videos_of_model


def _erase(leaving: Leaving) -> None:
    for model in TrainedModel.objects.filter(owner=leaving.racer):
        remove_videos_of_model(model=model)


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
    erase=_erase,
    policies=[
        RetentionPolicy(
            "videos",
            "VIDEO_DAYS",
            lambda before, now: videos_to_purge(now),
            lambda rows, now: purge_videos(now=now),
            lambda rows: rows.aggregate(size=Sum("size"))["size"] or 0,
        )
    ],
)
