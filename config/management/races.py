"""The race that a command's ``--race`` names: by the address of its page on this site, or by the last part of that."""

from __future__ import annotations

from difflib import get_close_matches
from typing import NamedTuple

from config.management import Refusal
from config.management.tracks import FoundTrack, has_database
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue.names import NEAREST
from paddock.rules.race import RaceRules
from races.layout import race_rules
from races.models import Race
from races.ranking import laps_needed


class FoundRace(NamedTuple):
    """What a run of a race is told, and what its laps are worth there: ranking method and laps in a row."""

    track: FoundTrack
    rules: RaceRules
    ranking_method: str
    laps_needed: int


def find_race(name: str) -> FoundRace:
    """The race of this site's database, whoever may see it: commands are the operator's.

    Raises Refusal of ``race_not_found``, of ``database_not_ready`` where there is none, UserFault for a track whose
    shape nobody here knows.
    """
    if not has_database():
        raise Refusal(PlatformFault("database_not_ready", problem="there is no database yet"))
    slug = name.partition("?")[0].partition("#")[0].rstrip("/").rpartition("/races/")[2].partition("/")[0]
    race = Race.objects.select_related("track").filter(slug=slug).first() if "\0" not in slug else None
    if race is None:
        known = list(Race.objects.values_list("slug", flat=True))
        nearest = get_close_matches(slug, known, n=NEAREST, cutoff=0)
        raise Refusal(UserFault("race_not_found", name=name, nearest=", ".join(nearest) or "-"))
    track = FoundTrack(race.track.geometry, race.track.look)
    return FoundRace(track, race_rules(race), race.ranking_method, laps_needed(race))
