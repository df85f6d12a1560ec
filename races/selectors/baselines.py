"""House cars as what racers measure themselves by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..models import Entry
from .boards import CLASSIFIED, ORDER, BoardRow


def to_beat(podiums: Mapping[int, Sequence[BoardRow]]) -> dict[int, Entry]:
    """For each race where no racer is classified the best house car that is, by the race's id: one query or none.

    ``podiums``: what :func:`podiums` said of them. Races without a classified house car are left out.
    """
    waiting = [pk for pk, rows in podiums.items() if not rows]
    if not waiting:
        return {}
    entries = Entry.objects.filter(CLASSIFIED, race__in=waiting, withdrawn_at=None, is_baseline=True)
    best: dict[int, Entry] = {}
    for entry in entries.select_related("racer").order_by(*ORDER):
        best.setdefault(entry.race_id, entry)
    return best
