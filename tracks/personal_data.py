"""Personal data of tracks."""

from contextlib import suppress

from django.db import transaction
from django.db.models import ProtectedError

from core.personal_data.rules import Leaving, PersonalData, register

from .models import ReferenceLap, Track


def _erase(leaving: Leaving) -> None:
    """Delete the racer's tracks on which nothing was driven."""
    for track in Track.objects.filter(owner=leaving.racer):
        with suppress(ProtectedError), transaction.atomic():
            track.delete()


register(
    "tracks",
    PersonalData(
        Track,
        owner="owner",
        erased="owner",
        kept={"Races are driven on the track. Unused tracks are deleted.": "name description npy"},
        section="tracks",
        exported="name description",
        withheld={"The page of the track offers its file.": "npy"},
    ),
    PersonalData(
        ReferenceLap,
        kept={"It is a lap of the site's own driver.": "reason_params operator_detail laps trace trace_sha256"},
    ),
    erase=_erase,
)
