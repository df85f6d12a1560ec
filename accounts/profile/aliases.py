"""Changes a racer's alias: seldom, with its history, and never into one that looks like somebody else's."""

from datetime import datetime, timedelta

from django.conf import settings
from django.db import IntegrityError, transaction

from core.database.locks import hold
from paddock.errors import UserFault

from ..class_accounts.services import is_learner
from ..models import ALIAS_VALIDATORS, PastAlias, Racer
from ..signing_in.reserved_aliases import folded, forget_reservation, is_reserved, is_taken, reserve


def next_change_at(racer: Racer, now: datetime) -> datetime | None:
    """When the racer may change the alias again; None: now."""
    last = racer.past_aliases.values_list("changed_at", flat=True).first()
    at = None if last is None else last + timedelta(days=settings.ALIAS_CHANGE_DAYS)
    return None if at is None or at <= now else at


def former_owner_of(alias: str) -> Racer | None:
    """The latest former owner of an alias (in any letter case) with an account."""
    past = PastAlias.objects.filter(alias__iexact=alias, racer__is_active=True).select_related("racer").first()
    return None if past is None else past.racer


@transaction.atomic
def change_alias(*, racer: Racer, alias: str, now: datetime) -> Racer:
    """Give a racer another alias. The one before stays theirs for ``ALIAS_RESERVED_DAYS``. Raises ValidationError for
    its form, UserFault("alias_of_class" | "alias_too_soon" | "alias_same" | "alias_reserved" | "alias_taken")."""
    if is_learner(racer):
        raise UserFault("alias_of_class")
    hold(racer)
    racer.refresh_from_db()
    for validate in ALIAS_VALIDATORS:
        validate(alias)
    if alias == racer.alias:
        raise UserFault("alias_same")
    if next_change_at(racer, now) is not None:
        raise UserFault("alias_too_soon", days=settings.ALIAS_CHANGE_DAYS)
    if is_reserved(alias):
        raise UserFault("alias_reserved")
    others = Racer.objects.exclude(pk=racer.pk).values_list("alias", flat=True)
    if is_taken(alias, now, racer) or folded(alias) in map(folded, others.iterator()):
        raise UserFault("alias_taken")
    PastAlias.objects.create(racer=racer, alias=racer.alias, changed_at=now)
    reserve(alias=racer.alias, until=now + timedelta(days=settings.ALIAS_RESERVED_DAYS), racer=racer)
    forget_reservation(alias=alias)
    racer.alias = alias
    try:
        with transaction.atomic():
            racer.save(update_fields=["alias"])
    except IntegrityError:  # somebody signed up with it in this very moment
        raise UserFault("alias_taken") from None
    return racer
