"""The order in which a race's rows are locked: entries by their numbers, then the race; the counts of its board come
last, by the triggers that a change of an entry fires (:mod:`races.board_triggers`). Whoever changes an entry and may
touch its race as well takes both first, or two such on PostgreSQL wait for each other."""

from __future__ import annotations

from collections.abc import Iterable

from ..models import Entry, Race


def lock_entries(numbers: Iterable[int]) -> list[Entry]:
    """The entries with these primary keys in that order, locked with their races, as they are now. Call it in a
    transaction."""
    locked = Entry.objects.select_for_update(of=("self",)).filter(pk__in=list(numbers))
    entries = list(locked.order_by("pk"))
    wanted = sorted({entry.race_id for entry in entries})
    # read under their locks: what the entries' query saw of them may be older
    races = {race.pk: race for race in Race.objects.select_for_update(no_key=True).filter(pk__in=wanted).order_by("pk")}
    for entry in entries:
        entry.race = races[entry.race_id]
    return entries


def lock_entry(entry: Entry) -> Entry:
    """The same for one. Raises Entry.DoesNotExist."""
    found = lock_entries([entry.pk])
    if not found:
        raise Entry.DoesNotExist
    return found[0]
