"""Taking up invitations to sign up, and ending all access that was there before."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from allauth.account.models import EmailAddress
from django.db import transaction
from django.db.models import F
from knox.models import get_token_model

from paddock.errors import UserFault

from .models import KnownAddress, SignUpInvitation
from .second_factor import forget_second_factor
from .signals import account_taken_over

if TYPE_CHECKING:
    from accounts.models import Racer


def take_up_invitation(*, code: str, now: datetime) -> None:
    """Count one more racer who signed up with the invitation; in the transaction that makes the racer.

    A guarded UPDATE: two who hold the last place do not both get it. Raises UserFault("sign_up_invitation").
    """
    taken = SignUpInvitation.objects.filter(code=code, used__lt=F("uses"), expires_at__gt=now).update(
        used=F("used") + 1
    )
    if not taken:
        raise UserFault("sign_up_invitation")


def end_access(*, racer: Racer) -> None:
    """There is a new password: what was let in by the one before is so no more. Sessions end by themselves, for each is
    signed with a part of the password's hash."""
    get_token_model().objects.filter(user=racer).delete()
    KnownAddress.objects.filter(racer=racer).delete()


@transaction.atomic
def take_over(*, racer: Racer) -> bool:
    """Somebody has shown, by resetting the password, that the address of the account is theirs; False where that was
    known before.

    Whoever signed up with it was perhaps somebody else: nothing that they have left is to open it again. The address is
    verified now, others and second factors go, and other rooms hear of it (:mod:`accounts.signals`).
    """
    addresses = EmailAddress.objects.filter(user=racer)
    if addresses.filter(verified=True).exists():
        return False
    addresses.exclude(email=racer.email).delete()
    EmailAddress.objects.update_or_create(user=racer, email=racer.email, defaults={"verified": True, "primary": True})
    forget_second_factor(racer=racer)
    account_taken_over.send(sender=type(racer), racer=racer)
    return True
