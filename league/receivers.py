"""What the league does when the rooms below tell something."""

from __future__ import annotations

from datetime import datetime

from accounts.models import Racer
from races.models import Race

from .models import Round, Webhook
from .services.stewards import correct_results


def follow_board(sender: object, *, race: Race, now: datetime, **kwargs: object) -> None:
    """The board of a race changed after the fact: an official round under review follows it."""
    round_ = Round.objects.filter(race=race, closed_at__isnull=False).select_related("season", "race").first()
    if round_ is not None:
        correct_results(round=round_, now=now)


def drop_webhooks(sender: object, *, racer: Racer, **kwargs: object) -> None:
    """Whoever made them was perhaps not the owner of the racer's address, and is told nothing more."""
    Webhook.objects.filter(owner=racer).delete()
