"""Taking up invitations to sign up."""

from __future__ import annotations

from datetime import datetime

from django.db.models import F

from faults import UserFault

from .models import SignUpInvitation


def take_up_invitation(*, code: str, now: datetime) -> None:
    """Count one more racer who signed up with the invitation; in the transaction that makes the racer.

    A guarded UPDATE: two who hold the last place do not both get it. Raises UserFault("sign_up_invitation").
    """
    taken = SignUpInvitation.objects.filter(code=code, used__lt=F("uses"), expires_at__gt=now).update(
        used=F("used") + 1
    )
    if not taken:
        raise UserFault("sign_up_invitation")
