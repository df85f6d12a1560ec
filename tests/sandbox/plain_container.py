"""``python -m tests.sandbox.plain_container ARGUMENT...``: run Python with these as in a plain container.

Docker's and Podman's profile without CAP_SYS_ADMIN: ``unshare``, ``setns``, ``mount`` and their like answer EPERM, and
so does ``clone`` for any new namespace; ``clone3`` is "not there", so that libraries fall back to ``clone``.
"""

from __future__ import annotations

import errno
import os
import sys

import pyseccomp as scmp

NAMESPACES = 0x7E020000  # CLONE_NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET
REFUSED = ("unshare", "setns", "mount", "umount2", "pivot_root")


def shut() -> None:
    """Install the profile's part that concerns namespaces, for this process and all that it starts."""
    rules = scmp.SyscallFilter(scmp.ALLOW)
    for name in REFUSED:
        rules.add_rule(scmp.ERRNO(errno.EPERM), name)
    for bit in (1 << place for place in range(32) if NAMESPACES >> place & 1):
        rules.add_rule(scmp.ERRNO(errno.EPERM), "clone", scmp.Arg(0, scmp.MASKED_EQ, bit, bit))
    rules.add_rule(scmp.ERRNO(errno.ENOSYS), "clone3")
    rules.load()


if __name__ == "__main__":
    shut()
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
