"""Limits on log-in attempts that cannot be used to lock another racer out.

Wrong guesses are counted of one racer from one address, from one address for all racers, and of one racer from all
addresses. The last two do not apply to an address from which the racer has logged in before. Guesses by e-mail address
and by alias are counted apart, so that the counts do not reveal the owner of an address.
"""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

from django.db.models import Q
from django.http import HttpRequest
from django.utils.crypto import salted_hmac

from core.rate_limits import Count, address_of, count

from ..models import KnownAddress, Racer

RATES = {"racer_from_address": "5/5m", "address": "60/5m,600/d", "racer": "20/h", "challenge": "60/m"}
KNOWN_FOR = timedelta(days=90)
KNOWN_PER_RACER = 20
SEEN_AGAIN_AFTER = timedelta(days=1)  # so that not every log-in writes


def racer_with(credentials: Mapping[str, Any]) -> Racer | None:
    """The one racer whose password decides: by e-mail address, verified ones first, else by alias."""
    email, alias = (credentials.get("email") or "").lower(), credentials.get("username")
    found: list[Racer] = []
    if email:
        listed = Q(emailaddress__email=email)
        verified = Racer.objects.filter(listed, emailaddress__verified=True)
        found = list(verified or Racer.objects.filter(listed | Q(email=email)).distinct())
    # an address that somebody else is only about to change to is not theirs yet
    own = next((racer for racer in found if racer.email == email), None)
    return own or next(iter(found), None) or (Racer.objects.filter(alias__iexact=alias).first() if alias else None)


def begin(request: HttpRequest, credentials: Mapping[str, Any], now: datetime) -> Count | None:
    """Count an attempt to log in, before the password is looked at; None where it is one too many."""
    racer = racer_with(credentials)
    email = credentials.get("email")
    # counts by address and by alias are apart: one count would reveal which alias belongs to an address
    named = "address" if email else "alias"
    name = f"{named} of {racer.pk}" if racer else str(email or credentials.get("username")).casefold()
    address = address_of(request)
    limits = [("racer_from_address", f"{address} {name}")]
    if not is_known(racer, address, now):
        limits += [("address", address), ("racer", name)]
    attempt = Count()
    for action, key in limits:
        counted = count(f"accounts:{action}", key, RATES[action])
        if counted is None:
            attempt.rollback()
            return None
        attempt.marks += counted.marks
    return attempt


def may_ask_for_challenge(request: HttpRequest) -> bool:
    """Count a guest's request for a passkey challenge, which needs a session; False beyond the limit."""
    return count("accounts:challenge", address_of(request), RATES["challenge"]) is not None


def is_known(racer: Racer | None, address: str, now: datetime) -> bool:
    """Whether the racer has logged in from this address in the last 90 days."""
    if racer is None:
        return False
    known = KnownAddress.objects.filter(racer=racer, digest=_digest(racer, address))
    return known.filter(seen_at__gt=now - KNOWN_FOR).exists()


def remember_address(*, racer: Racer, request: HttpRequest, now: datetime) -> None:
    """Store that the racer has logged in from this address. Keeps the last 20."""
    address = address_of(request)
    if not address:
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
