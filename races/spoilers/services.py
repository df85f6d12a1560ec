"""Hiding results from a racer until they have watched the race: every write."""

from datetime import datetime

from accounts.models import Racer

from ..models import LiveEvent, Race, WatchedRace


def hide_results(*, racer: Racer, now: datetime) -> None:
    """Hide results of races from ``now`` on; those that were over before stay shown. Again: nothing changes."""
    if racer.hides_results_since is None:
        Racer.objects.filter(pk=racer.pk, hides_results_since=None).update(hides_results_since=now)
        racer.refresh_from_db(fields=["hides_results_since"])


def show_results(*, racer: Racer) -> None:
    """Show all results again. Watched races are kept for the next time."""
    Racer.objects.filter(pk=racer.pk).update(hides_results_since=None)
    racer.hides_results_since = None


def note_watched(*, racer: Racer, race: Race, now: datetime) -> None:
    """The racer has watched the race, or wants its results: they are hidden no more. That they may see the race is the
    caller's word."""
    values = {"at": now, "live": has_begun(race)}
    WatchedRace.objects.update_or_create(racer=racer, race=race, defaults=values)


def has_begun(race: Race) -> bool:
    """Whether the race has a live event that has begun."""
    return LiveEvent.objects.filter(race=race, begun_at__isnull=False).exists()
