"""Which addresses are this site's own: those of the machine, and what the site's names lead to.

Behind a router the public address is on no interface, and still leads back here; it is found by the site's name.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Callable, Iterable
from contextlib import suppress
from urllib.parse import urlsplit

from django.conf import settings

Resolve = Callable[[str], list[str]]


def is_of_this_machine(address: str) -> bool:
    """Whether an interface of this machine has this IP address: the kernel lets nobody bind to another."""
    ip = ipaddress.ip_address(address.split("%")[0])
    family = socket.AF_INET if ip.version == 4 else socket.AF_INET6
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind((str(ip), 0))
        return True
    return False


def own_names() -> list[str]:
    """The host names that the site answers to, small letters, without the wildcards."""
    names = [urlsplit(settings.SITE_URL).hostname or "", *settings.ALLOWED_HOSTS]
    return sorted({name.strip("[]").lstrip(".").rstrip(".").lower() for name in names} - {"", "*"})


def leads_home(host: str, addresses: Iterable[str], resolve: Resolve) -> bool:
    """Whether a host with these addresses is this machine or this site. ``resolve``: the addresses of a name, raises
    OSError where there are none."""
    names = own_names()
    if host.rstrip(".").lower() in names:
        return True
    ours: set[str] = set()
    for name in names:
        with suppress(OSError):
            ours.update(resolve(name))
    return any(address in ours or is_of_this_machine(address) for address in addresses)
