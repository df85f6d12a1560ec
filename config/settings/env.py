"""Typed readers for environment variables: a wrong value stops the start with a sentence, not with a traceback."""

import os
import re
import stat
import sys
from email.utils import parseaddr
from pathlib import Path
from urllib.parse import SplitResult, urlsplit
from zoneinfo import ZoneInfo

import dj_database_url
from django.core.exceptions import ImproperlyConfigured

from accounts.profile.regions import regions_in
from core.files.private_folders import make_private_folder
from core.logs.lines import as_printed

# What may stand in Django's ALLOWED_HOSTS: a name, a name below a domain (".example.org"), an address, or anything
_HOST = re.compile(r"\*|\.?[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*|\[[0-9A-Fa-f:.]+\]")

# libpq's: a server that is gone without a word is given up within a minute, and not by TCP after hours
_PATIENCE = {
    **{"connect_timeout": 10, "keepalives_idle": 30, "keepalives_interval": 10, "keepalives_count": 3},
    "tcp_user_timeout": 60_000,
}

# What Paddock writes into its data folder; any of these may be first: a benchmark creates only the locks
_OURS = {
    "celerybeat-schedule",
    "files",
    "health.json",
    "locks",
    "lti-key.pem",
    "mail",
    "metrics",
    "paddock.sqlite3",
    "run.lock",
    "secret-key",
    "static",
    "static.collected",
    "streams",
    "uploads",
    "valkey",
}


def env_str(name: str, default: str | None = None) -> str:
    """The text of variable ``name``. Raises ImproperlyConfigured when it is unset and there is no default."""
    value = os.environ.get(name, default)
    if value is None:
        raise ImproperlyConfigured(f"Set the environment variable {name}.")
    return value


def env_listen(name: str) -> tuple[str, int] | None:
    """An address and a port to listen on, or None. Raises ImproperlyConfigured for anything else."""
    value = os.environ.get(name, "")
    host, _, port = value.rpartition(":")
    if not value:
        return None
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ImproperlyConfigured(f"{name} must be an address and a port such as 127.0.0.1:9464, not {value!r}.")
    return host.strip("[]"), int(port)


def env_token(name: str) -> str:
    """A secret of at least 16 letters, digits and signs, or nothing. Raises ImproperlyConfigured otherwise."""
    value = os.environ.get(name, "")
    if value and not re.fullmatch(r"[\w.~+/=-]{16,}", value, re.ASCII):
        raise ImproperlyConfigured(f"{name} must have at least 16 letters, digits and signs of .~+/=_-")
    return value


def env_bool(name: str, default: bool) -> bool:
    """``True`` or ``False``, spelled exactly so. Raises ImproperlyConfigured for anything else."""
    value = os.environ.get(name)
    if value is None:
        return default
    if value not in ("True", "False"):
        raise ImproperlyConfigured(f"{name} must be True or False, not {value!r}.")
    return value == "True"


def env_int(name: str, default: int, *, minimum: int = 0, maximum: int | None = None) -> int:
    """A whole number of at least ``minimum`` and at most ``maximum``. Raises ImproperlyConfigured otherwise."""
    value = os.environ.get(name)
    if value is None:
        return default
    try:
        number = int(value)
    except ValueError:
        raise ImproperlyConfigured(f"{name} must be a whole number, not {value!r}.") from None
    if number < minimum:
        raise ImproperlyConfigured(f"{name} must be at least {minimum}, not {number}.")
    if maximum is not None and number > maximum:
        raise ImproperlyConfigured(f"{name} must be at most {maximum}, not {number}.")
    return number


def env_list(name: str, default: str = "") -> list[str]:
    return [word.strip() for word in os.environ.get(name, default).split(",") if word.strip()]


def env_choice(name: str, default: str, choices: tuple[str, ...]) -> str:
    """One of ``choices``. Raises ImproperlyConfigured for anything else."""
    value = os.environ.get(name, default)
    if value not in choices:
        raise ImproperlyConfigured(f"{name} must be one of {', '.join(choices)}, not {value!r}.")
    return value


def env_url(name: str, default: str, schemes: tuple[str, ...], example: str) -> str:
    """An address with one of ``schemes``, a host or a path, and a valid port; unset or empty is ``default``. Raises
    ImproperlyConfigured otherwise, with ``example``."""
    value = os.environ.get(name, "") or default
    if value:
        check_url(name, value, schemes, example)
    return value


def check_url(name: str, value: str, schemes: tuple[str, ...], example: str) -> SplitResult:
    """The parts of an address; see :func:`env_url`. Errors do not quote a password in it."""
    try:
        parts = urlsplit(value)
        usable = parts.scheme in schemes and bool(parts.hostname or "unix" in parts.scheme or "socket" in parts.scheme)
        _ = parts.port  # raises where it is not a number or out of range
    except ValueError:
        usable = False
    if not usable or any(mark.isspace() for mark in value):
        raise ImproperlyConfigured(f"{name} must be an address such as {example}.")
    return parts


def passkeys_work(site_url: str) -> bool:
    """Whether browsers make passkeys for a site at this address: one with a name, over https or on this machine."""
    parts = urlsplit(site_url)
    host = parts.hostname or ""
    if host == "localhost":
        return True
    is_address = ":" in host or host.replace(".", "").isdigit()
    return parts.scheme == "https" and not is_address


def env_hosts(name: str, default: str) -> list[str]:
    """Comma-separated host names as ALLOWED_HOSTS takes them. Raises ImproperlyConfigured for an invalid host name."""
    hosts = env_list(name, default)
    for host in hosts:
        if not _HOST.fullmatch(host):
            raise ImproperlyConfigured(
                f"{name} must be host names separated by commas, without http:// and port, not {host!r}."
            )
    return hosts


def env_database(name: str, default: str) -> dj_database_url.DBConfig:
    """Django's settings of a database on PostgreSQL or SQLite. Raises ImproperlyConfigured for any other address."""
    schemes = ("postgres", "postgresql", "pgsql", "sqlite")
    example = "postgres://user:password@host:5432/name"
    value = os.environ.get(name, "") or default
    try:
        if urlsplit(value).scheme not in schemes:
            raise ValueError(value)
        database = dj_database_url.parse(value, conn_max_age=60, conn_health_checks=True)
    except ValueError:  # what dj_database_url raises is one, too
        raise ImproperlyConfigured(f"{name} must be an address such as {example}.") from None
    if database["ENGINE"].endswith("postgresql"):
        database["OPTIONS"] = _PATIENCE | database.get("OPTIONS", {})
    return database


def env_time_zone(name: str, default: str) -> str:
    """A time zone by its name, such as Asia/Seoul. Raises ImproperlyConfigured for what is none."""
    value = os.environ.get(name, default)
    try:
        ZoneInfo(value)
    except (ValueError, OSError, KeyError):
        raise ImproperlyConfigured(f"{name} must be a time zone such as Europe/Berlin, not {value!r}.") from None
    return value


def env_time(name: str, default: str) -> str:
    """A time of day such as 20:00, or nothing. Raises ImproperlyConfigured for anything else."""
    value = os.environ.get(name, default)
    if value and not re.fullmatch(r"([01]\d|2[0-3]):[0-5]\d", value):
        raise ImproperlyConfigured(f"{name} must be a time of day such as 20:00, or empty, not {value!r}.")
    return value


def env_regions(name: str) -> str:
    """Regions of countries, see :func:`accounts.profile.regions.regions_in`. Raises ImproperlyConfigured otherwise."""
    value = os.environ.get(name, "")
    try:
        regions_in(value)
    except ValueError as problem:
        raise ImproperlyConfigured(f"{name} must be like 'Asia: KR JP; Europe: DE FR': {problem}.") from None
    return value


def env_sender(name: str, default: str) -> str:
    """An e-mail address, also with a name before it. Raises ImproperlyConfigured for what is none."""
    value = os.environ.get(name, default)
    address = parseaddr(value)[1]
    if not re.fullmatch(r"[^@\s]+@[^@\s]+", address) or not value.isprintable():
        raise ImproperlyConfigured(f"{name} must be an e-mail address such as paddock@example.org, not {value!r}.")
    return value


def env_folder(name: str, default: Path) -> Path:
    """A folder, created for its owner only; a relative one counts from the current folder. Raises ImproperlyConfigured
    when it cannot be created or written."""
    try:
        folder = Path(os.environ.get(name, "") or default).expanduser().resolve()
        make_private_folder(folder)
    except (OSError, ValueError, RuntimeError) as error:
        why = getattr(error, "strerror", None) or error
        raise ImproperlyConfigured(
            f"{name} must be a folder that can be made and written: {os.environ.get(name, default)!s}: {why}."
        ) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ImproperlyConfigured(f"{name} must be a folder that can be written, which {folder} is not.")
    return folder


def private_folder(name: str, folder: Path) -> Path:
    """The folder, closed to everybody but its owner: the secret key, sessions and racers' files are in it.

    An open folder is closed, with a line on standard error. Raises ImproperlyConfigured when it belongs to somebody
    else or holds other programs' files.
    """
    found = folder.stat()
    if not found.st_mode & 0o077:
        return folder
    kept = {one.name for one in os.scandir(folder)}
    why = ""
    if found.st_mode & stat.S_ISVTX or (kept and not kept & _OURS):
        why = "and holds what is not Paddock's; name a folder that is for Paddock alone"
    elif os.geteuid() not in (0, found.st_uid):
        why = "and belongs to somebody else"
    else:
        try:
            folder.chmod(0o700)
        except OSError as error:
            why = f"and cannot be closed: {error.strerror}"
    if why:
        raise ImproperlyConfigured(f"{name}: other users of this machine may read {folder} {why}.")
    closed = f"{name}: {folder} was open to other users of this machine; it is its owner's alone now."
    print(as_printed(closed), file=sys.stderr)
    return folder
