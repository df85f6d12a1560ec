"""Writes of sign-up and log-in: invitations, the first admin, confirmed addresses and account take-overs."""

from collections.abc import Collection
from datetime import datetime

from allauth.account.models import EmailAddress
from django.conf import settings
from django.contrib.auth import get_user_model
from django.contrib.auth.password_validation import validate_password
from django.db import transaction
from django.db.models import F
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from paddock.errors import UserFault

from ..models import Racer, SignUpInvitation
from ..signals import account_taken_over
from .second_factor import forget_second_factor

OPEN, INVITATION, SINGLE_SIGN_ON, CLOSED = "open", "invitation", "sso", "closed"

# The key in a visitor's session of the invitation whose link was followed.
CODE = "sign_up_invitation"


def may_sign_up(request: HttpRequest) -> bool:
    """Whether this visitor may sign up, with a password or by a provider."""
    if settings.SIGN_UP == INVITATION:
        return open_invitation(request.session.get(CODE, ""), timezone.now()) is not None
    return settings.SIGN_UP == OPEN


def is_of_domain(email: str, domains: Collection[str]) -> bool:
    """Whether the address is of one of these domains; one that begins with a dot stands for those below it."""
    domain = email.rpartition("@")[2].lower()
    return any(domain == one or (one.startswith(".") and domain.endswith(one)) for one in domains)


def require_welcome_domain(email: str) -> None:
    """Raises UserFault("sign_up_domain") for an address of a domain that this site does not take."""
    if settings.SIGN_UP_DOMAINS and not is_of_domain(email, settings.SIGN_UP_DOMAINS):
        raise UserFault("sign_up_domain", domains=", ".join(settings.SIGN_UP_DOMAINS))


def may_use_password(racer: Racer) -> bool:
    """Whether the racer may log in by password (PADDOCK_PASSWORD_RACERS)."""
    return not settings.PASSWORD_RACERS or racer.alias.lower() in settings.PASSWORD_RACERS


def open_invitation(code: str, now: datetime) -> SignUpInvitation | None:
    """The invitation with this code, if somebody may still sign up with it."""
    found = SignUpInvitation.objects.filter(code=code).first() if code else None
    return found if found is not None and found.is_open(now) else None


def take_up_invitation(*, code: str, now: datetime) -> None:
    """Count one more sign-up by a guarded UPDATE. Raises UserFault("sign_up_invitation")."""
    taken = SignUpInvitation.objects.filter(code=code, used__lt=F("uses"), expires_at__gt=now).update(
        used=F("used") + 1
    )
    if not taken:
        raise UserFault("sign_up_invitation")


@transaction.atomic
def take_over(*, racer: Racer) -> bool:
    """Confirm the account's address after a password reset by its mailbox's owner; False if it was confirmed before.

    Another person may have signed up with the address, so other addresses and second factors are removed.
    """
    addresses = EmailAddress.objects.filter(user=racer)
    if addresses.filter(verified=True).exists():
        return False
    addresses.exclude(email=racer.email).delete()
    confirm_address(racer=racer)
    forget_second_factor(racer=racer)
    account_taken_over.send(sender=type(racer), racer=racer)
    return True


@audited("admin.created", _("Admin created"))
@transaction.atomic
def create_admin(*, alias: str, email: str, password: str) -> Racer:
    """An admin with every permission, whose e-mail address counts as confirmed. Raises ValidationError."""
    racer = get_user_model()(alias=alias, email=email.lower(), is_staff=True, is_superuser=True)
    racer.full_clean(exclude=["password"])
    validate_password(password, racer)
    racer.set_password(password)
    racer.save()
    confirm_address(racer=racer)
    return racer


def confirm_address(*, racer: Racer) -> None:
    """Mark the account's e-mail address as verified and primary."""
    EmailAddress.objects.update_or_create(user=racer, email=racer.email, defaults={"verified": True, "primary": True})
