"""Sentences of a live event, and the words that its stories share."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from datetime import datetime

from django.utils.translation import gettext as _

TRACED = 6  # of so many runs also what a car did between two lines is told; reading all of them would take seconds


@dataclass(frozen=True)
class Sentence:
    """A sentence. ``at``: when it was seen; ``kind``: what it is about, for its colour."""

    at: datetime
    kind: str
    text: str

    @property
    def key(self) -> str:
        """What tells it from others on a page that renews itself."""
        return f"{self.at:%H%M%S%f}-{zlib.crc32(self.text.encode()):x}"


def incident(kind: str) -> str:
    """What went wrong with ``racer`` in ``lap``."""
    return {
        "off_track": _("%(racer)s leaves the track in lap %(lap)s."),
        "crashed": _("%(racer)s hits something in lap %(lap)s."),
        "immobilized": _("%(racer)s stands still in lap %(lap)s."),
        "reversed": _("%(racer)s drives the wrong way in lap %(lap)s."),
        "time_up": _("%(racer)s's time is up."),
    }[kind]


def ordinal(place: int) -> str:
    """A place in words: ``1st``, ``12th``, ``23rd``."""
    if place % 100 not in (11, 12, 13):
        words = {1: _("%(place)sst"), 2: _("%(place)snd"), 3: _("%(place)srd")}.get(place % 10)
        if words:
            return words % {"place": place}
    return _("%(place)sth") % {"place": place}


def seconds(ms: int) -> str:
    """A time of a story: ``8.531 s``, from a minute on ``1:08.531``."""
    return f"{ms // 60_000}:{ms / 1000 % 60:06.3f}" if ms >= 60_000 else f"{ms / 1000:.3f} s"
