"""Who may try to log in: limits on wrong guesses that nobody can use to lock another racer out.

Three counts, all of wrong guesses only (a right one takes back what it has counted):

- of one racer from one address, which alone would let a crowd of addresses guess;
- from one address, whoever is guessed, so that one machine does not try its way through all racers;
- of one racer from all addresses together.

Guesses by a racer's e-mail address and by their alias are counted apart, so that nobody learns whose address it is.

The last two do not hold where the racer has logged in from this very address before: whatever others do, from there or
from elsewhere, its owner comes in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from allauth.account.internal.userkit import filter_users_by_email, get_user_by_username
from allauth.core.internal import ratelimit
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest
from django.utils.crypto import salted_hmac

from .models import KnownAddress

if TYPE_CHECKING:
    from accounts.models import Racer

RATES = {
    "racer_from_address": "5/5m/key",
    "address": "60/5m/key,600/d/key",
    "racer": "20/h/key",
    "challenge": "60/m/key",
}
KNOWN_FOR = timedelta(days=90)
KNOWN_PER_RACER = 20
SEEN_AGAIN_AFTER = timedelta(days=1)  # so that not every log-in writes


@dataclass
class Attempt:
    """What one attempt has counted."""

    counted: list[ratelimit.RateLimitUsage] = field(default_factory=list)

    def rollback(self) -> None:
        """Count it no more: the password was right, or nothing was tried after all."""
        for usage in self.counted:
            usage.rollback()


def racer_with(credentials: Mapping[str, Any]) -> Racer | None:
    """The one racer whose password decides: by e-mail address, verified ones first, else by alias."""
    email, alias = credentials.get("email"), credentials.get("username")
    found = filter_users_by_email(email, prefer_verified=True, for_login=True) if email else []
    # an address that somebody else is only about to change to is not theirs yet
    own = next((racer for racer in found if racer.email == (email or "").lower()), None)
    return own or next(iter(found), None) or (get_user_by_username(alias) if alias else None)


def begin(request: HttpRequest, credentials: Mapping[str, Any], now: datetime) -> Attempt | None:
    """Count an attempt to log in, before the password is looked at; None where it is one too many."""
    racer = racer_with(credentials)
    email = credentials.get("email")
    # by address and by alias apart: were they one count, who uses up that of an address would see whose alias is stuck
    named = "address" if email else "alias"
    who = f"{named} of {racer.pk}" if racer else str(email or credentials.get("username")).casefold()
    address = ratelimit.get_ip(request)
    limits = [("racer_from_address", f"{address} {who}")]
    if not is_known(racer, address, now):
        limits += [("address", address), ("racer", who)]
    attempt = Attempt()
    for action, key in limits:
        usage = ratelimit.consume(request, app="accounts", action=action, config=RATES, key=key, limit_get=True)
        if usage is None:
            attempt.rollback()
            return None
        attempt.counted.append(usage)
    return attempt


def may_ask_for_challenge(request: HttpRequest) -> bool:
    """Count a guest who asks for a passkey's challenge, which a session keeps; False where it is one too many."""
    address = ratelimit.get_ip(request)
    usage = ratelimit.consume(request, app="accounts", action="challenge", config=RATES, key=address, limit_get=True)
    return usage is not None


def is_known(racer: Racer | None, address: str, now: datetime) -> bool:
    """Whether the racer has logged in from this address in the last 90 days."""
    if racer is None:
        return False
    known = KnownAddress.objects.filter(racer=racer, digest=_digest(racer, address))
    return known.filter(seen_at__gt=now - KNOWN_FOR).exists()


def remember_address(*, racer: Racer, request: HttpRequest, now: datetime) -> None:
    """The racer has just proven from this address who they are. Keeps the last 20."""
    try:
        address = ratelimit.get_ip(request)
    except PermissionDenied:  # a request that came over no network
        return
    digest = _digest(racer, address)
    known = KnownAddress.objects.filter(racer=racer, digest=digest).first()
    if known is not None and now - known.seen_at < SEEN_AGAIN_AFTER:
        return
    KnownAddress.objects.update_or_create(racer=racer, digest=digest, defaults={"seen_at": now})
    newest = KnownAddress.objects.filter(racer=racer).order_by("-seen_at").values_list("pk", flat=True)
    KnownAddress.objects.filter(racer=racer).exclude(pk__in=list(newest[:KNOWN_PER_RACER])).delete()


def _digest(racer: Racer, address: str) -> str:
    """Addresses are kept as digests: enough to know one again, and nobody's list of where people were."""
    return salted_hmac("accounts.log_in", f"{racer.pk} {address}", algorithm="sha256").hexdigest()
