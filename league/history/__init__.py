"""Seasons as folders: ``races.csv`` and a file of results for each race, in the form of the old service's export."""

from .form import LAPS_COLUMNS, RACE_COLUMNS, RESULT_COLUMNS, RaceRow, ResultRow
from .reading import ReadRace, ReadSeason, read_folder

__all__ = [
    "LAPS_COLUMNS",
    "RACE_COLUMNS",
    "RESULT_COLUMNS",
    "RaceRow",
    "ReadRace",
    "ReadSeason",
    "ResultRow",
    "read_folder",
]
