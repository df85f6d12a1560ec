"""What the league does when the rooms below tell something."""

from __future__ import annotations

from datetime import datetime
from functools import partial

from django.db import transaction

from accounts.models import Racer
from evaluation.models import Evaluation, Result
from races.models import Race

from .models import Round, Webhook
from .services.ratings import rate_season
from .services.stewards import correct_results


def follow_board(sender: object, *, race: Race, now: datetime, **kwargs: object) -> None:
    """The board of a race changed after the fact: an official round under review follows it."""
    round_ = Round.objects.filter(race=race, closed_at__isnull=False).select_related("season", "race").first()
    if round_ is not None:
        correct_results(round=round_, now=now)


def follow_late_result(
    sender: object, *, evaluation: Evaluation, result: Result | None, now: datetime, **kwargs: object
) -> None:
    """A car that was timed again after its round became official: the season follows, while the window is open."""
    race = Race.objects.filter(entries__submissions__evaluation=evaluation, round__closed_at__isnull=False).first()
    if race is not None and result is not None:
        # once the standing is written, whichever room hears of it first
        transaction.on_commit(partial(follow_board, sender, race=race, now=now), robust=True)


def drop_webhooks(sender: object, *, racer: Racer, **kwargs: object) -> None:
    """Whoever made them was perhaps not the owner of the racer's address, and is told nothing more."""
    Webhook.objects.filter(owner=racer).delete()


def rate_duels(sender: object, *, race: Race, now: datetime, **kwargs: object) -> None:
    """A race of a season has driven its last duel: the season's ratings follow."""
    round_ = Round.objects.filter(race=race).select_related("season").first()
    if round_ is not None:
        rate_season(season=round_.season)
