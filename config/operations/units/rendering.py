"""Renders the units from the list of programs of ``manage.py run``."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

from django.conf import settings

from config.operations.run import VIDEO_WORKER_NICE
from config.serving.forking import PYTHON
from core.jobs import DRAINED_STATUS
from paddock.errors import UserFault

from . import texts

_USER = re.compile(r"[a-z_][a-z0-9_-]{0,31}")
_PLACE = re.compile(r"/[\w./+@-]*", re.ASCII)
_PLAIN_WORD = re.compile(r"[\w./:@,=+-]+", re.ASCII)
_HOMES = ("/home", "/root", "/run/user")


def unit_name(program: str) -> str:
    return f"paddock-{program}.service"


def render_units(
    commands: Mapping[str, Sequence[str]], *, user: str, env_file: Path, backups: Path | None = None
) -> dict[str, str]:
    """The text of each unit by its file name: one for each of ``commands`` (program to command), the target that
    starts them, and with ``backups`` a nightly backup into that folder. Raises UserFault ``units_refused``."""
    _check_user(user)
    places = {"env_file": env_file, "checkout": settings.BASE_DIR, "data": settings.DATA_DIR, "python": Path(PYTHON[0])}
    for name, place in {**places, "backups": backups or Path("/")}.items():
        if not _PLACE.fullmatch(str(place)):
            raise refused(f"systemd would not read the path {place} ({name}); only letters, digits and _ - . + @ / may")
    if any(settings.DATA_DIR.is_relative_to(folder) for folder in ("/tmp", "/var/tmp")):
        raise refused(f"{settings.DATA_DIR} is a temporary folder, of which each unit has its own")
    for socket in (settings.VALKEY_SOCKET, settings.STREAM_SOCKET):
        if not socket.is_relative_to(settings.DATA_DIR):
            raise refused(f"the path {settings.DATA_DIR} is too long for a socket; choose a shorter PADDOCK_DATA")
    common: dict[str, object] = {"user": user, **places, "broker_folder": settings.VALKEY_DIR}
    units = {unit_name(name): _program(name, command, commands, common) for name, command in commands.items()}
    wants = list(units)
    if backups is not None:
        common |= {"backups": backups, "hardening": _hardening(backups), "confinement": _confinement(texts.PLAIN)}
        units["paddock-backup.service"] = texts.BACKUP.substitute(common)
        units["paddock-backup.timer"] = texts.TIMER.substitute() + _install(texts.TARGET_NAME)
        wants.append("paddock-backup.timer")
    return units | {
        texts.TARGET_NAME: texts.TARGET.substitute(wants=" ".join(wants)) + _install(texts.SERVICES),
    }


def refused(problem: str) -> UserFault:
    return UserFault("units_refused", problem=problem)


def _check_user(user: str) -> None:
    if not _USER.fullmatch(user):
        raise refused(f"{user!r} is no name of a user")
    if user == "root":
        raise refused("the units are for an ordinary user; create one, for example with useradd --system paddock")


def _program(
    name: str, command: Sequence[str], commands: Mapping[str, Sequence[str]], common: dict[str, object]
) -> str:
    needs = texts.NEEDS[name]
    more = Template(needs.more).substitute(common)
    if name == "video-worker":
        more += f"Nice={VIDEO_WORKER_NICE}\n"
    after = " " + unit_name("broker") if "broker" in commands and name != "broker" else ""
    if needs.sandbox:
        confinement = texts.SANDBOXING.substitute(no_code="no" if needs.torch else "yes")
    else:
        confinement = _confinement(texts.PLAIN, local=needs.local)
    values = {
        "description": needs.description,
        "after": after,
        "command": " ".join(map(_quoted, command)),
        "more": more,
        "memory_mb": needs.memory_mb(),
        "drained": DRAINED_STATUS,
        "hardening": _hardening(),
        "confinement": confinement,
    }
    return texts.PROGRAM.substitute(common | values) + _install(texts.TARGET_NAME)


def _confinement(text: Template, local: bool = False) -> str:
    return text.substitute(families="AF_UNIX" if local else "AF_UNIX AF_INET AF_INET6 AF_NETLINK")


def _hardening(*writable: Path) -> str:
    """``ProtectHome`` hides the homes unless something of ours lies there."""
    places = (settings.DATA_DIR, *writable)
    ours = (*places, settings.BASE_DIR, Path(PYTHON[0]).resolve())
    at_home = any(place.is_relative_to(home) for place in ours for home in _HOMES)
    return texts.HARDENING.substitute(
        writable=" ".join(map(str, places)), home="read-only" if at_home else "yes"
    ).rstrip()


def _install(wanted_by: str) -> str:
    return texts.INSTALL.substitute(wanted_by=wanted_by)


def _quoted(word: str) -> str:
    """A word of a command as systemd reads it: ``%`` and ``$`` are its own."""
    word = word.replace("%", "%%").replace("$", "$$")
    if _PLAIN_WORD.fullmatch(word.replace("%%", "")):
        return word
    return '"' + word.replace("\\", "\\\\").replace('"', '\\"') + '"'
