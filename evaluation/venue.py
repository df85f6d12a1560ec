"""Where a race is held: all that has to be known to draw and measure a track before a car is on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paddock.geometry.track import TrackGeometry


@dataclass(frozen=True)
class Venue:
    """A track, the direction in which it is driven, and what cameras see of it (the name of one of
    ``paddock.simulator.camera.theme.THEMES``)."""

    track: TrackGeometry
    direction: str
    look: str

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, for a process of ours."""
        return {"track": self.track.to_dict(), "direction": self.direction, "look": self.look}
