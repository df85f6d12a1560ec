"""Audits for pages and API: the drives of a track are driven once and kept, and a racer has one audit at a time."""

from __future__ import annotations

import json
import threading
import zlib
from typing import TYPE_CHECKING

from django.core.cache import cache

from paddock.rules.race import OBJECT_AVOIDANCE, TIME_TRIAL

from ..check_slots import one_check

if TYPE_CHECKING:
    from accounts.models import Racer
    from tracks.models import Track

    from .drives import RecordedDrive
    from .report import RewardAudit

KEPT_S = 24 * 3600  # some 200 KB a track
_FORM = 1  # of what is kept
_driving = threading.Lock()


def audited(*, owner: Racer, code: str, track: Track, direction: str, race_type: str, discount: float) -> RewardAudit:
    """The audit of a reward function on a track. Raises UserFault ``reward_check_runs`` and ``track_shape_unknown``;
    PlatformFault as :func:`training.rewards.validation.check_reward`."""
    from .report import audit_reward  # imports the simulator, which no other page needs

    with one_check(owner):
        drives = drives_on(track, direction, race_type)
        return audit_reward(code.replace("\r\n", "\n"), drives, discount=discount)


def drives_on(track: Track, direction: str, race_type: str) -> list[RecordedDrive]:
    """The eight drives on a track, from the cache or driven now. A process drives one track at a time: a class that
    begins at once asks for the same."""
    from paddock.simulator.engine import ENGINE_ID

    from ..sandbox.function import from_wire, to_wire
    from .drives import RecordedDrive, eight_drives

    kind = TIME_TRIAL if race_type == TIME_TRIAL else OBJECT_AVOIDANCE
    key = f"reward-drives-{_FORM}-{ENGINE_ID}-{track.fingerprint}-{direction}-{kind}"
    kept = cache.get(key)
    if kept is None:
        with _driving:
            kept = cache.get(key)
            if kept is None:
                drives = eight_drives(track.geometry, direction, kind)
                facts = [[drive.name, len(drive.states), drive.lap_ms, drive.ended, drive.seconds] for drive in drives]
                data = {"facts": facts, **to_wire([state for drive in drives for state in drive.states])}
                cache.set(key, zlib.compress(json.dumps(data).encode(), 6), KEPT_S)
                return list(drives)
    data = json.loads(zlib.decompress(kept))
    states = iter(from_wire(data))
    found = []
    for name, steps, lap_ms, ended, seconds in data["facts"]:
        own = tuple(next(states) for _ in range(steps))
        found.append(RecordedDrive(name, own, lap_ms, ended, seconds))
    return found
