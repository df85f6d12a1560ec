"""The setup of a race: its venue, and the check of its number of cars."""

from dataclasses import dataclass
from typing import TypedDict

from paddock.errors import UserFault
from paddock.geometry.track import TrackDocument, TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, MAX_CARS, RaceRules


class VenueDocument(TypedDict):
    track: TrackDocument
    direction: str
    look: str


@dataclass(frozen=True)
class Venue:
    """A track, the direction in which it is driven, and what cameras see of it (the name of one of
    ``paddock.simulator.camera.theme.THEMES``)."""

    track: TrackGeometry
    direction: str
    look: str

    def to_dict(self) -> VenueDocument:
        """For a process of ours."""
        return {"track": self.track.to_dict(), "direction": self.direction, "look": self.look}


def check_rivals(rules: RaceRules, rivals: int) -> None:
    """Raise UserFault (``rivals_race_type``, ``rivals_with_bots``, ``too_many_rivals``) unless so many may join."""
    if not rivals:
        return
    if rules.race_type != HEAD_TO_HEAD:
        raise UserFault("rivals_race_type")
    if rules.bots:
        raise UserFault("rivals_with_bots")
    if rivals >= MAX_CARS:
        raise UserFault("too_many_rivals", limit=MAX_CARS - 1)
