"""Personal data of tracks."""

from core.personal_data.rules import PersonalData, register

from .models import Track

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
)
