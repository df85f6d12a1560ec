"""POST requests to addresses that racers wrote down: never to this machine or its own network.

The name is looked up once, all its addresses must be public, and the connection goes to the very address that was
looked at, so that a name that changes its mind leads nowhere else. Redirects are not followed.
"""

from __future__ import annotations

import http.client
import ipaddress
import socket
import ssl
from collections.abc import Mapping
from contextlib import suppress
from threading import Timer
from urllib.parse import SplitResult, urlsplit

from faults import UserFault

CONNECT_S, WHOLE_S = 5, 10
# all that was ever given out; outside it are site-local addresses and IPv4 in several disguises
_UNICAST = ipaddress.ip_network("2000::/3")
_NAT64 = ipaddress.ip_network("64:ff9b::/96")


def checked(url: str) -> SplitResult:
    """The parts of an address that may be posted to. Raises UserFault("webhook_address")."""
    try:
        parts = urlsplit(url)
        fine = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0
    except ValueError:
        fine = False
    if not fine or parts.username is not None or parts.password is not None or not url.isascii():
        raise UserFault("webhook_address")
    return parts


def is_public(address: str) -> bool:
    """Whether an address belongs to the internet at large: not loopback, private, link-local, shared or multicast."""
    ip = ipaddress.ip_address(address.split("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None) or getattr(ip, "sixtofour", None)
    if mapped is not None:
        ip = mapped
    if ip.version == 6 and ip in _NAT64:
        ip = ipaddress.ip_address(int(ip) & 0xFFFF_FFFF)
    if ip.version == 6 and ip not in _UNICAST:
        return False
    return ip.is_global and not ip.is_multicast


def public_addresses(host: str, port: int, *, allow_private: bool = False) -> list[str]:
    """The addresses of a host. Raises UserFault("webhook_private") if any is not public, OSError without any."""
    found = [one[4][0] for one in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    if not allow_private and not all(is_public(address) for address in found):
        raise UserFault("webhook_private", host=host)
    return found


def post(url: str, body: bytes, headers: Mapping[str, str], *, allow_private: bool = False) -> int:
    """POST ``body`` and return the status of the answer, within ten seconds.

    Raises UserFault("webhook_address" | "webhook_private"), OSError, ssl.SSLError, http.client.HTTPException.
    """
    parts = checked(url)
    port = parts.port or (443 if parts.scheme == "https" else 80)
    address = public_addresses(parts.hostname, port, allow_private=allow_private)[0]
    connection = http.client.HTTPConnection(parts.hostname, port, timeout=CONNECT_S)
    sock = socket.create_connection((address, port), timeout=CONNECT_S)

    def cut_off() -> None:
        with suppress(OSError):
            sock.shutdown(socket.SHUT_RDWR)

    # an answer that trickles in byte by byte does not hold the sender
    deadline = Timer(WHOLE_S, cut_off)
    deadline.daemon = True
    deadline.start()
    try:
        if parts.scheme == "https":
            sock = ssl.create_default_context().wrap_socket(sock, server_hostname=parts.hostname)
        connection.sock = sock
        path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        connection.request("POST", path, body, dict(headers))
        return connection.getresponse().status
    finally:
        deadline.cancel()
        connection.close()
        sock.close()
