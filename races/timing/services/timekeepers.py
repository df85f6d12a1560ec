"""The timekeepers of a race, and the models of its real cars."""

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from evaluation.models import TrainedModel
from evaluation.selectors import can_use_model
from paddock.errors import UserFault

from ...entries.time_checks import require_not_over
from ...models import Entry, Race, TimedSession, Timekeeper
from .checks import require_organiser, require_physical

MOST_TIMEKEEPERS = 50


@audited("timekeeper.named", _("Timekeeper named"))
@transaction.atomic
def name_timekeeper(*, race: Race, alias: str, by: Racer, now: datetime) -> Timekeeper:
    """Let a racer take times in a race; naming them again changes nothing. Raises UserFault("race_not_physical" |
    "race_not_yours" | "timekeeper_unknown" | "timekeepers_too_many")."""
    require_organiser(race, by)
    racer = Racer.objects.filter(alias__iexact=alias.strip(), is_active=True, is_house=False).first()
    if racer is None:
        raise UserFault("timekeeper_unknown", racer=alias.strip()[:64])
    named = Timekeeper.objects.filter(race=race, racer=racer).first()
    if named is None:
        if race.timekeepers.count() >= MOST_TIMEKEEPERS:
            raise UserFault("timekeepers_too_many", most=MOST_TIMEKEEPERS)
        named, _ = Timekeeper.objects.get_or_create(race=race, racer=racer, defaults={"named_at": now})
    return named


@audited("timekeeper.dismissed", _("Timekeeper dismissed"), target="race")
def dismiss_timekeeper(*, race: Race, racer: Racer, by: Racer) -> bool:
    """Remove a timekeeper, whose laps stay. Returns whether there was one. Raises UserFault("race_not_physical" |
    "race_not_yours")."""
    require_organiser(race, by)
    return bool(Timekeeper.objects.filter(race=race, racer=racer).delete()[0])


@transaction.atomic
def choose_car(*, entry: Entry, model: TrainedModel | None, now: datetime) -> Entry:
    """Set the racer's model in their real car, for later sessions and earlier ones without a model; None hides it.
    Raises UserFault("race_not_physical" | "race_closed" | "race_cancelled" | "model_not_yours")."""
    require_physical(entry.race)
    require_not_over(entry.race, now)
    if model is not None and not can_use_model(entry.racer, model):
        raise UserFault("model_not_yours")
    Entry.objects.filter(pk=entry.pk).update(model=model)
    if model is not None:
        TimedSession.objects.filter(entry=entry, model=None).update(model=model)
    entry.model = model
    return entry
