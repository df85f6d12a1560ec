"""Finds out which layers of the sandbox this host offers, by building it.

Level 2 ("lock") is the minimum: no_new_privs, Landlock, seccomp, rlimits and, under root, a private user id. Level 3
("namespaces") adds bubblewrap. ``PADDOCK_SANDBOX_LEVEL=3`` makes that the minimum.
"""

import functools
import os
from dataclasses import asdict, dataclass, replace

from . import bubblewrap, landlock, seccomp, uids
from .frames import FrameError, read_message
from .limits import PROBE
from .start import LEVEL_LOCK, LEVEL_NAMESPACES, LEVEL_NONE, LEVEL_PARTIAL, start

MINIMUM_LEVEL = LEVEL_LOCK
LEVEL_NAMES = {
    LEVEL_NONE: "none",
    LEVEL_PARTIAL: "partial",
    LEVEL_LOCK: "lock",
    LEVEL_NAMESPACES: "lock and namespaces",
}
_VARIABLE = "PADDOCK_SANDBOX_LEVEL"
FILTERED = "; a seccomp profile around this process refuses it, see docs/operators.md, In a container"
CONFINED = "; AppArmor refuses it to ordinary users, see docs/operators.md, On Ubuntu"
_CONFINING = "/proc/sys/kernel/apparmor_restrict_unprivileged_userns"


@dataclass(frozen=True)
class Layer:
    """One layer: its name, whether it works here, and what was found or is missing (English, for operators)."""

    name: str
    available: bool
    detail: str


@dataclass(frozen=True)
class SandboxReport:
    """What this host offers. ``level``: one of :data:`LEVEL_NAMES`; ``minimum``: what this installation requires."""

    layers: list[Layer]
    level: int
    minimum: int

    @property
    def name(self) -> str:
        return LEVEL_NAMES[self.level]

    @property
    def sufficient(self) -> bool:
        return self.level >= self.minimum

    def to_dict(self) -> dict[str, object]:
        return {**asdict(self), "name": self.name, "sufficient": self.sufficient}

    def table(self) -> str:
        width = max(len(layer.name) for layer in self.layers)
        lines = [
            f"  {'ok  ' if layer.available else 'none'}  {layer.name:<{width}}  {layer.detail}" for layer in self.layers
        ]
        verdict = "models may run" if self.sufficient else "nothing runs"
        lines.append(
            f"Sandbox level {self.level} ({self.name}), at least {self.minimum} ({LEVEL_NAMES[self.minimum]}) "
            f"asked for: {verdict}."
        )
        return "\n".join(lines)


@functools.cache
def probe() -> SandboxReport:
    """Probe once per process. Takes about a tenth of a second, starts one short-lived sandboxed process; a second one
    where there are no namespaces: within them the same lock closes."""
    parts = [_landlock(), _seccomp(), _private_uid()]
    possible, outside = all(part.available for part in parts), _bubblewrap()
    spaces = _attempt(LEVEL_NAMESPACES, "namespaces", possible and outside.available, "needs the lock and bubblewrap")
    if spaces.available:
        locked = replace(spaces, name="lock")
    else:
        locked = _attempt(LEVEL_LOCK, "lock", possible, "a layer above is missing")
    if spaces.available:
        level = LEVEL_NAMESPACES
    elif locked.available:
        level = LEVEL_LOCK
    else:
        level = LEVEL_PARTIAL if any(part.available for part in parts[:2]) else LEVEL_NONE
    return SandboxReport([*parts, locked, outside, spaces], level, minimum_level())


_kept = probe


def look_again() -> SandboxReport:
    """Probe anew: the result may have changed since this process began."""
    _kept.cache_clear()
    return probe()


def require(minimum: int | None = None) -> int:
    """The level of this host, if it is at least ``minimum`` (default: what is configured). Raises PlatformFault
    ``sandbox_unavailable`` otherwise."""
    from paddock.errors import PlatformFault

    report = probe()
    wanted = report.minimum if minimum is None else max(minimum, MINIMUM_LEVEL)
    if report.level < wanted:
        fault = PlatformFault("sandbox_unavailable", level=report.level, minimum=wanted)
        fault.add_note(report.table())
        raise fault
    return report.level


def _hint() -> str:
    """What around this process refuses namespaces."""
    if bubblewrap.is_filtered():
        return FILTERED
    try:
        with open(_CONFINING, encoding="ascii") as setting:
            return CONFINED if setting.read().strip() == "1" and os.geteuid() != 0 else ""
    except OSError:
        return ""


def minimum_level() -> int:
    """``PADDOCK_SANDBOX_LEVEL`` (2 or 3), or 2. Raises ValueError for anything else: nobody can ask for less."""
    text = os.environ.get(_VARIABLE, "").strip() or str(MINIMUM_LEVEL)
    if text not in (str(LEVEL_LOCK), str(LEVEL_NAMESPACES)):
        raise ValueError(f"{_VARIABLE}={text!r}: write {LEVEL_LOCK} (lock) or {LEVEL_NAMESPACES} (lock and namespaces)")
    return int(text)


def _landlock() -> Layer:
    version = landlock.abi()
    detail = f"ABI {version}" if version else "not in this kernel, or switched off: boot with lsm=landlock,..."
    return Layer("Landlock", version > 0, detail)


def _seccomp() -> Layer:
    try:
        size = len(seccomp.build()) // 8
    except (OSError, RuntimeError, ImportError) as error:
        return Layer("seccomp", False, f"{error}: install libseccomp2")
    return Layer("seccomp", True, f"allow-list of {size} instructions")


def _private_uid() -> Layer:
    name = "private user id"
    if os.geteuid() != 0:
        return Layer(name, True, f"not needed: not root but {os.geteuid()}")
    try:
        claimed = uids.claim()
    except (OSError, ValueError) as error:
        return Layer(name, False, str(error))
    claimed.close()
    uid_range = uids.configured_range()
    return Layer(name, True, f"one of {uid_range[0]}-{uid_range[-1]} for each process")


def _bubblewrap() -> Layer:
    path = bubblewrap.find()
    return Layer("bubblewrap", path is not None, path or "not installed: apt-get install bubblewrap")


def _attempt(level: int, name: str, possible: bool, otherwise: str) -> Layer:
    """Build the sandbox at ``level`` and ask from inside what is open."""
    if not possible:
        return Layer(name, False, otherwise)
    try:
        with start("evaluation.sandbox.self_check", PROBE, level) as process:
            try:
                found, _ = read_message(process.stdout, process.deadline)
            except FrameError as error:
                status = process.wait(0.5)
                lines = process.stderr_text().strip().splitlines()[-1:] or [str(error)]
                hint = _hint() if level == LEVEL_NAMESPACES else ""
                return Layer(name, False, f"did not start (exit status {status}): {lines[0]}{hint}")
    except (OSError, ValueError, RuntimeError) as error:
        return Layer(name, False, str(error))
    if found["open"]:
        return Layer(name, False, f"open from inside: {', '.join(found['open'])}")
    return Layer(name, True, f"closed from inside, as user {found['uid']}")
