"""POST requests to addresses that racers wrote down: never to this machine or its own network.

The name is looked up once, all its addresses must be public and none of them this site's, and the connection goes to
the very address that was looked at, so that a name that changes its mind leads nowhere else. Redirects are not
followed. All of it together takes no longer than :data:`WHOLE_S`.
"""

from __future__ import annotations

import http.client
import ipaddress
import socket
import ssl
from collections.abc import Mapping
from contextlib import suppress
from threading import Thread, Timer
from time import monotonic
from urllib.parse import SplitResult, urlsplit

from paddock.errors import UserFault

from .own_addresses import leads_home

LOOKUP_S, CONNECT_S, WHOLE_S = 4.0, 5.0, 10.0
# all that was ever given out; outside it are site-local addresses and IPv4 in several disguises
_UNICAST = ipaddress.ip_network("2000::/3")
_NAT64 = ipaddress.ip_network("64:ff9b::/96")
# public by number, but each machine in that cloud reaches its own host's agent there
_CLOUDS_OWN = (ipaddress.ip_address("168.63.129.16"),)


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


def plain(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """An address without its disguise: the IPv4 address that an IPv6 one stands for, if it does."""
    ip = ipaddress.ip_address(address.split("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None) or getattr(ip, "sixtofour", None)
    if mapped is not None:
        return mapped
    if ip.version == 6 and ip in _NAT64:
        return ipaddress.ip_address(int(ip) & 0xFFFF_FFFF)
    return ip


def is_public(address: str) -> bool:
    """Whether an address belongs to the internet at large: not loopback, private, link-local, shared or multicast."""
    ip = plain(address)
    if ip.version == 6 and ip not in _UNICAST:
        return False
    return ip.is_global and not ip.is_multicast and ip not in _CLOUDS_OWN


def addresses_of(host: str) -> list[str]:
    """What a name leads to. Raises OSError without any, TimeoutError after :data:`LOOKUP_S`: resolvers drip too."""
    found: list[str] = []
    failed: list[OSError] = []

    def look_up() -> None:
        try:
            found.extend(str(one[4][0]) for one in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM))
        except UnicodeError:  # a label that is empty or too long
            failed.append(socket.gaierror(socket.EAI_NONAME, "no such name"))
        except OSError as error:
            failed.append(error)

    looking = Thread(target=look_up, daemon=True)
    looking.start()
    looking.join(LOOKUP_S)
    if failed:
        raise failed[0]
    if looking.is_alive() or not found:
        raise TimeoutError("no address in time")
    return found


def public_addresses(host: str, *, allow_private: bool = False) -> list[str]:
    """The addresses of a host. Raises UserFault("webhook_private") if any is not public or is this site's, OSError
    without any."""
    found = addresses_of(host)
    if allow_private:
        return found
    if not all(is_public(address) for address in found) or leads_home(
        host, {str(plain(address)) for address in found}, addresses_of
    ):
        raise UserFault("webhook_private", host=host)
    return found


def post(url: str, body: bytes, headers: Mapping[str, str], *, allow_private: bool = False) -> int:
    """POST ``body`` and return the status of the answer, within ten seconds.

    Raises UserFault("webhook_address" | "webhook_private"), OSError, ssl.SSLError, http.client.HTTPException.
    """
    parts = checked(url)
    host, port = parts.hostname or "", parts.port or (443 if parts.scheme == "https" else 80)
    until = monotonic() + WHOLE_S
    address = public_addresses(host, allow_private=allow_private)[0]
    sock = socket.create_connection((address, port), timeout=max(0.1, min(CONNECT_S, until - monotonic())))
    # of its own: TLS takes the first one over before its handshake is done, which may drip as well
    handle = sock.dup()

    def cut_off() -> None:
        with suppress(OSError):
            handle.shutdown(socket.SHUT_RDWR)

    connection = http.client.HTTPConnection(host, port, timeout=CONNECT_S)
    # an answer that trickles in byte by byte does not hold the sender
    deadline = Timer(max(0.1, until - monotonic()), cut_off)
    deadline.daemon = True
    deadline.start()
    try:
        if parts.scheme == "https":
            sock = ssl.create_default_context().wrap_socket(sock, server_hostname=host)
        connection.sock = sock
        path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        connection.request("POST", path, body, dict(headers))
        return connection.getresponse().status
    except (OSError, http.client.HTTPException) as error:
        if monotonic() >= until:
            raise TimeoutError("timeout") from error
        raise
    finally:
        deadline.cancel()
        connection.close()
        sock.close()
        handle.close()


def host_of(url: str) -> str:
    """The host of an address that :func:`checked` has let pass, in small letters; deliveries to it take turns.

    With scheme and port where they are not those of https: one program there may be away while another answers, and
    nobody shall have a host paused for all by naming a port of it where nothing listens.
    """
    parts = urlsplit(url)
    host, port = (parts.hostname or "").rstrip("."), parts.port
    if parts.scheme != "https" or port not in (None, 443):
        host = f"{parts.scheme}://{host}:{port or (443 if parts.scheme == 'https' else 80)}"
    return host[:255]
