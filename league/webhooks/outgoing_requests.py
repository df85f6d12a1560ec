"""Requests to addresses that racers and platforms name, never to this machine or its network."""

import http.client
import ipaddress
import re
import socket
import ssl
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from threading import Thread, Timer
from time import monotonic
from urllib.parse import SplitResult, urlsplit

from django.conf import settings

from paddock.errors import UserFault

_WRITTEN = re.compile(r"[!-~]+")
_NUMBER = re.compile(r"[0-9]+|0x[0-9a-f]*", re.IGNORECASE)
_LABEL = r"[a-z0-9_](?:[a-z0-9_-]{0,61}[a-z0-9_])?"
_HOST = re.compile(rf"(?!.{{254}}){_LABEL}(?:\.{_LABEL})*\.?", re.IGNORECASE)

LOOKUP_S, CONNECT_S, WHOLE_S = 4.0, 5.0, 10.0
# all that was ever given out; outside it are site-local addresses and IPv4 in several disguises
_UNICAST = ipaddress.ip_network("2000::/3")
_NAT64 = ipaddress.ip_network("64:ff9b::/96")
# last labels that the internet never has (RFC 6761, 6762, 7686 and 9476, ICANN's "internal", and home routers' own)
_NO_NAMES = ("localhost", "local", "localdomain", "internal", "invalid", "test", "onion", "alt", "lan", "home", "corp")
LONGEST = 500
# public by number, but each machine in that cloud reaches its own host's agent there
_CLOUDS_OWN = (ipaddress.ip_address("168.63.129.16"),)


def checked(url: str) -> SplitResult:
    """The parts of an address that may be posted to. Raises UserFault("webhook_address")."""
    try:
        parts = urlsplit(url)
        fine = parts.scheme in ("http", "https") and _is_host(parts.hostname or "") and parts.port != 0
    except ValueError:
        fine = False
    # urlsplit drops line breaks and tabs without a word
    if not fine or "@" in parts.netloc or not _WRITTEN.fullmatch(url):
        raise UserFault("webhook_address")
    return parts


def refuse_undeliverable(url: str, *, allow_private: bool = False) -> None:
    """Raises UserFault("webhook_address" | "webhook_name" | "webhook_private") for an address that no delivery could
    reach. A name without an address now is accepted: it may get one. Not in a transaction: it may take seconds."""
    host = checked(url).hostname or ""
    if "#" in url or len(url) > LONGEST:
        raise UserFault("webhook_address")
    if not allow_private:
        with suppress(OSError):
            public_addresses(host)


def _is_host(host: str) -> bool:
    """Labels of a name, or an IP address in any notation that a connection takes: also 2130706433 and 0x7f.1."""
    if ":" in host:
        return "%" not in host  # a zone means something on one machine only
    return bool(_HOST.fullmatch(host)) and (_is_ipv4(host) or not _NUMBER.fullmatch(host.rstrip(".").split(".")[-1]))


def _is_ipv4(host: str) -> bool:
    try:
        return bool(socket.inet_aton(host))
    except OSError:
        return False


def _leads_nowhere(host: str) -> bool:
    """Whether it is a name that the internet does not have."""
    labels = host.rstrip(".").lower().split(".")
    return not (":" in host or _is_ipv4(host)) and (len(labels) == 1 or labels[-1] in _NO_NAMES)


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
    """The addresses of a host. Raises UserFault("webhook_name") for a name that the internet does not have,
    UserFault("webhook_private") if any address is not public or is this site's, OSError without any."""
    if not allow_private and _leads_nowhere(host):
        raise UserFault("webhook_name", host=host)
    found = addresses_of(host)
    if allow_private:
        return found
    if not all(map(is_public, found)) or leads_home(host, {str(plain(address)) for address in found}):
        raise UserFault("webhook_private", host=host)
    return found


@dataclass(frozen=True)
class OutgoingAnswer:
    """What was answered; ``body`` is empty where none was wanted."""

    status: int
    headers: Mapping[str, str]
    body: bytes = b""


def post(url: str, body: bytes, headers: Mapping[str, str], *, allow_private: bool = False) -> int:
    """POST ``body`` and return the status of the answer. Raises as :func:`ask`."""
    return ask("POST", url, body, headers, allow_private=allow_private).status


def ask(
    method: str,
    url: str,
    body: bytes | None,
    headers: Mapping[str, str],
    *,
    allow_private: bool = False,
    limit: int = 0,
) -> OutgoingAnswer:
    """Send a request and return the answer, with a body of at most ``limit`` bytes, within ten seconds. A redirect is
    an answer.

    Raises UserFault("webhook_address" | "webhook_name" | "webhook_private"), OSError, ssl.SSLError,
    http.client.HTTPException.
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
        connection.request(method, path, body, dict(headers))
        answer = connection.getresponse()
        read = answer.read(limit + 1) if limit else b""
        if len(read) > limit:
            raise http.client.HTTPException("the answer is too long")
        return OutgoingAnswer(answer.status, dict(answer.getheaders()), read)
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


def is_of_this_machine(address: str) -> bool:
    """Whether an interface of this machine has this IP address: the kernel lets nobody bind to another."""
    ip = ipaddress.ip_address(address.split("%")[0])
    family = socket.AF_INET if ip.version == 4 else socket.AF_INET6
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind((str(ip), 0))
        return True
    return False


def leads_home(host: str, addresses: Iterable[str]) -> bool:
    """Whether a host with these addresses is this machine, or a host name that the site answers to."""
    names = [urlsplit(settings.SITE_URL).hostname or "", *settings.ALLOWED_HOSTS]
    ours = {name.strip("[]").lstrip(".").rstrip(".").lower() for name in names} - {"", "*"}
    if host.rstrip(".").lower() in ours:
        return True
    found: set[str] = set()
    for name in sorted(ours):
        with suppress(OSError):
            found.update(addresses_of(name))
    return any(address in found or is_of_this_machine(address) for address in addresses)
