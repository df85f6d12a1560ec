"""Limits on attempts, counted in the cache; a count can be taken back."""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from ipaddress import IPv4Address, IPv6Network, ip_address

from allauth.account.adapter import get_adapter
from django.core.cache import cache
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest

SECONDS = {"s": 1, "m": 60, "h": 3600, "d": 86_400}
LOCK_S, WAIT_S, STEP_S = 10, 1.0, 0.01  # a lock's life, and how long and how often another process tries to get it


@dataclass
class Count:
    """One counted attempt: the cache's key, the time and the window of each rate."""

    marks: list[tuple[str, float, int]] = field(default_factory=list)

    def rollback(self) -> None:
        """Take the count back."""
        for key, at, window_s in self.marks:
            with _locked(key) as locked:
                if locked:
                    cache.set(key, [other for other in cache.get(key, []) if other != at], window_s)


def count(action: str, key: str, rates: str) -> Count | None:
    """Count an attempt; None where a rate is used up. ``rates``: such as ``60/5m,600/d``, for each action and key."""
    counted = Count()
    for most, number, unit in re.findall(r"(\d+)/(\d*)([smhd])", rates):
        window_s = int(number or 1) * SECONDS[unit]
        place = f"rate:{action}:{most}/{window_s}:{sha256(key.encode()).hexdigest()}"
        with _locked(place) as locked:
            now = time.time()
            times = [at for at in cache.get(place, []) if at > now - window_s]
            if not locked or len(times) >= int(most):
                return None
            cache.set(place, [*times, now], window_s)
        counted.marks.append((place, now, window_s))
    return counted


def address_of(request: HttpRequest) -> str:
    """The network address of the client, in IPv6 its network of 64 bits; empty for a request over no network."""
    try:
        address = ip_address(get_adapter().get_client_ip(request))
    except (PermissionDenied, ValueError):
        return ""
    return str(address if isinstance(address, IPv4Address) else IPv6Network((address, 64), False).network_address)


@contextmanager
def _locked(key: str) -> Iterator[bool]:
    until = time.monotonic() + WAIT_S
    while not cache.add(f"{key}:lock", 1, LOCK_S):
        if time.monotonic() > until:
            yield False
            return
        time.sleep(STEP_S)
    try:
        yield True
    finally:
        cache.delete(f"{key}:lock")
