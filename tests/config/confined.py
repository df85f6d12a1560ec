"""Runs a command under the settings of a unit of systemd, done by hand, where no systemd runs: ``UNIT COMMAND...``.

It needs root to make the mounts, and becomes an ordinary user of a user namespace. A setting that it does not know is
an error unless it concerns the sandbox in no way.
"""

from __future__ import annotations

import ctypes
import errno
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pyseccomp

LIBC = ctypes.CDLL(None, use_errno=True)
NEWNS, NEWUSER = 0x20000, 0x10000000
READ_ONLY, NOSUID, NODEV, NOEXEC, REMOUNT, BIND, REC, PRIVATE = 1, 2, 4, 8, 32, 4096, 16384, 1 << 18
FAMILIES = {"AF_UNIX": 1, "AF_INET": 2, "AF_INET6": 10, "AF_NETLINK": 16}
WRITE_AND_EXECUTE, EXECUTE = 6, 4
UID = 1000


def settings_of(unit: Path) -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for line in unit.read_text().splitlines():
        name, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[name].append(value)
    return found


def main() -> None:
    chosen = settings_of(Path(sys.argv[1]))

    def on(name: str) -> bool:
        return chosen.get(name, ["no"])[-1] in ("yes", "strict", "invisible", "pid")

    _checked(LIBC.unshare(NEWNS), "unshare")
    mount(None, "/", REC | PRIVATE)
    for path in " ".join(chosen["ReadWritePaths"]).split():
        mount(path, path, BIND | REC)
    if on("ProtectSystem"):
        _make_read_only(" ".join(chosen["ReadWritePaths"]).split())
    if on("ProtectKernelTunables"):
        for path in ("/proc/sys", "/sys"):
            mount(path, path, BIND | REC)
            mount(None, path, BIND | REMOUNT | READ_ONLY | NOSUID | NODEV | NOEXEC)
    if on("ProcSubset"):
        mount("proc", "/proc", NOSUID | NODEV | NOEXEC, "proc", "subset=pid")
    _become_ordinary()
    _checked(LIBC.prctl(38, 1, 0, 0, 0), "no_new_privs")
    if on("ProtectHostname"):
        _refuse(lambda rules, refuse: rules.add_rule(refuse, "sethostname"))
    if on("MemoryDenyWriteExecute"):
        _refuse(_without_new_code)
    if on("RestrictNamespaces"):
        _refuse(_without_namespaces)
    if families := " ".join(chosen["RestrictAddressFamilies"]).split():
        _refuse(lambda rules, refuse: _only_families(rules, refuse, {FAMILIES[name] for name in families}))
    if calls := chosen["SystemCallFilter"]:
        _allow_only(calls)
    os.execvp(sys.argv[2], sys.argv[2:])


def mount(source: str | None, target: str, flags: int, kind: str = "", data: str = "") -> None:
    text = [None if not part else part.encode() for part in (source, target, kind, data)]
    _checked(LIBC.mount(text[0], text[1], text[2], ctypes.c_ulong(flags), text[3]), f"mount {target}")


def _checked(result: int, what: str) -> None:
    if result:
        raise OSError(ctypes.get_errno(), what)


def _make_read_only(writable: list[str]) -> None:
    for line in Path("/proc/self/mountinfo").read_text().splitlines():
        path = line.split()[4]
        if not path.startswith(("/dev", "/proc", "/sys")) and not any(
            Path(path).is_relative_to(one) for one in writable
        ):
            mount(None, path, BIND | REMOUNT | READ_ONLY)


def _become_ordinary() -> None:
    """A user without capabilities who may read what root may: the checkout of the test is root's."""
    ours, (reading, writing) = os.getpid(), os.pipe()
    if (helper := os.fork()) == 0:
        os.read(reading, 1)
        for name, text in (("uid_map", f"{UID} 0 1"), ("setgroups", "deny"), ("gid_map", f"{UID} 0 1")):
            Path(f"/proc/{ours}/{name}").write_text(text)
        os._exit(0)
    _checked(LIBC.unshare(NEWUSER), "user namespace")
    os.write(writing, b"x")
    os.waitpid(helper, 0)


def _refuse(add: Callable[[pyseccomp.SyscallFilter, int], None]) -> None:
    rules = pyseccomp.SyscallFilter(pyseccomp.ALLOW)
    add(rules, pyseccomp.ERRNO(errno.EPERM))
    rules.load()


def _without_new_code(rules: pyseccomp.SyscallFilter, refuse: int) -> None:
    masked = pyseccomp.MASKED_EQ
    rules.add_rule(refuse, "mmap", pyseccomp.Arg(2, masked, WRITE_AND_EXECUTE, WRITE_AND_EXECUTE))
    for name in ("mprotect", "pkey_mprotect"):
        rules.add_rule(refuse, name, pyseccomp.Arg(2, masked, EXECUTE, EXECUTE))


def _without_namespaces(rules: pyseccomp.SyscallFilter, refuse: int) -> None:
    for kind in (NEWNS, NEWUSER, 0x02000000, 0x04000000, 0x08000000, 0x20000000, 0x40000000):
        for call in ("unshare", "clone"):
            rules.add_rule(refuse, call, pyseccomp.Arg(0, pyseccomp.MASKED_EQ, kind, kind))
    rules.add_rule(pyseccomp.ERRNO(errno.ENOSYS), "clone3")


def _only_families(rules: pyseccomp.SyscallFilter, refuse: int, allowed: set[int]) -> None:
    for family in set(range(46)) - allowed:
        rules.add_rule(refuse, "socket", pyseccomp.Arg(0, pyseccomp.EQ, family))


def _allow_only(lines: list[str]) -> None:
    names: set[str] = set()
    for line in lines:
        words = [call for word in line.removeprefix("~").split() for call in _calls(word)]
        names = names - set(words) if line.startswith("~") else names | set(words)
    rules = pyseccomp.SyscallFilter(pyseccomp.ERRNO(errno.EPERM))
    for name in names:
        try:
            rules.add_rule(pyseccomp.ALLOW, name)
        except OSError:  # not of this processor
            continue
    rules.load()


def _calls(word: str) -> list[str]:
    if not word.startswith("@"):
        return [word]
    listed = subprocess.run(["systemd-analyze", "syscall-filter", word], capture_output=True, text=True, check=True)
    lines = [line.strip() for line in listed.stdout.splitlines()[1:]]
    return [call for line in lines if line and not line.startswith("#") for call in _calls(line)]


if __name__ == "__main__":
    main()
