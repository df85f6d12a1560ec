"""Deletes accounts. The rules of what goes and what stays are :mod:`core.personal_data`'s."""

from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.conf import settings
from django.db import transaction
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.locks import hold
from core.personal_data.erasing import erase
from core.personal_data.rules import Leaving, all_rooms
from paddock.errors import UserFault

from ..class_accounts.services import is_learner
from ..models import NAMELESS, DeletedAccount, Racer
from ..signing_in.reserved_aliases import reserve


def is_deletable(racer: Racer) -> bool:
    """Whether the account is a person's: no house car's, program's or guest's, not of an imported season or deleted."""
    unreal = racer.is_house or racer.is_program or racer.record_id is not None or racer.guest_name
    return not unreal and not racer.alias.startswith(NAMELESS)


def check_deletion(*, racer: Racer, now: datetime) -> None:
    """Raises UserFault("account_not_deletable"), and the faults of rooms where the racer must do something first."""
    if not is_deletable(racer):
        raise UserFault("account_not_deletable")
    for room in all_rooms():
        if room.check is not None:
            room.check(racer, now)


def check_own_deletion(*, racer: Racer, now: datetime) -> None:
    """As :func:`check_deletion`, for the racer themselves. Raises UserFault("account_of_class") for a class account."""
    if is_learner(racer):
        raise UserFault("account_of_class")
    check_deletion(racer=racer, now=now)


@audited("account.deleted", _("Account deleted"), target="racer")
@transaction.atomic
def delete_account(*, racer: Racer, by: Racer | None, now: datetime) -> DeletedAccount:
    """Delete an account for good. Results in races stay under :attr:`accounts.models.Racer.shown_name` without the
    name; files are deleted after the commit. Nobody can take the alias for ``ALIAS_RESERVED_DAYS``. Raises UserFault as
    :func:`check_deletion`."""
    hold(racer)
    racer = Racer.objects.get(pk=racer.pk)
    check_deletion(racer=racer, now=now)
    addresses = EmailAddress.objects.filter(user=racer).values_list("email", flat=True)
    aliases = {racer.alias, *racer.past_aliases.values_list("alias", flat=True)}
    nameless = f"{NAMELESS}{racer.pk}"
    erase(Leaving(racer, now, frozenset({*aliases, racer.email, *addresses}), nameless))
    for alias in aliases:
        reserve(alias=alias, until=now + timedelta(days=settings.ALIAS_RESERVED_DAYS), racer=None)
    racer.alias, racer.email = nameless, f"{nameless}@deleted.invalid"
    racer.country = racer.team = ""
    racer.avatar, racer.avatar_bytes, racer.last_login, racer.hides_results_since = None, 0, None, None
    racer.is_active = racer.is_staff = racer.is_superuser = False
    racer.set_unusable_password()
    racer.save()
    return DeletedAccount.objects.create(racer=racer, deleted_at=now, by_racer=by is not None and by.pk == racer.pk)
