"""A video of moments of several runs, one after the other: what it shows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from evaluation.models import Evaluation, State
from paddock.errors import UserFault

from .hooks import runs
from .models import WHOLE, Video
from .run import FORMAT, VideoRun

if TYPE_CHECKING:
    from videos.drawing import VideoScene

REEL_FORMAT = 1  # raise it whenever the picture of a reel changes and that of a run does not
_RELATED = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")


@dataclass(frozen=True)
class Segment:
    """A moment: the public id of its run, the number of the car that is followed, from when to when in simulated ms,
    and what is written below it, in the video's language."""

    run: str
    car: int
    start_ms: int
    end_ms: int
    caption: str

    def told(self) -> dict[str, Any]:
        """As a row keeps it."""
        return asdict(self)


def length_of(told: Mapping[str, Any]) -> int:
    """How long a kept moment takes, ms."""
    return int(told["end_ms"]) - int(told["start_ms"])


@dataclass(frozen=True)
class Reel:
    """The moments of a video, in their order."""

    segments: Sequence[Segment]
    language: str

    @classmethod
    def of(cls, video: Video) -> Reel:
        """What a row asks for."""
        return cls([Segment(**told) for told in video.segments or ()], video.language)

    @cached_property
    def _runs(self) -> dict[str, VideoRun]:
        wanted = {one.run for one in self.segments}
        found = Evaluation.objects.filter(public_id__in=wanted, state=State.FINISHED).select_related(*_RELATED)
        return {one.public_id: VideoRun.of(one) for one in found}

    def fingerprint(self) -> str:
        """64 hexadecimal digits that change with anything that the video would show; "" once it may not be shown any
        more: a run is gone, or its racer has left."""
        if not self.segments or not all(one.run in self._runs for one in self.segments):
            return ""
        if not runs().shown_together([one.run for one in self.segments]):
            return ""
        shown = [FORMAT, REEL_FORMAT, self.language, [[one.told(), self._runs[one.run].shown] for one in self.segments]]
        return hashlib.sha256(json.dumps(shown).encode()).hexdigest()

    def scenes(self) -> list[VideoScene]:
        """What is to be drawn. Reads the stored traces. Raises UserFault("video_run_not_finished") where a run is gone,
        PlatformFault("storage_failed")."""
        if not self.fingerprint():
            raise UserFault("video_run_not_finished")
        return [
            replace(
                self._runs[one.run].scene(one.car, WHOLE, self.language),
                window=(one.start_ms, one.end_ms),
                caption=one.caption,
            )
            for one in self.segments
        ]
