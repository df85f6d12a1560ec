"""One private user id for each sandboxed process, where the launcher is root.

RLIMIT_NPROC, signals and ptrace are per user id and do not bind root, so every process gets an id that no account and
no other sandbox of this host has (:mod:`.claims`).
"""

from __future__ import annotations

import os
import pwd

from .claims import Claim
from .claims import claim as claim_name

DEFAULT_RANGE = range(70000, 71000)
_VARIABLE = "PADDOCK_SANDBOX_UIDS"


class PrivateUid:
    """A claimed user id (also used as the group id). Close it when the process is gone."""

    def __init__(self, uid: int, claim: Claim) -> None:
        self.uid = uid
        self._claim = claim

    def __enter__(self) -> PrivateUid:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def close(self) -> None:
        self._claim.close()


def configured_range() -> range:
    """``PADDOCK_SANDBOX_UIDS`` as ``first-last``, or the default. Raises ValueError with the problem."""
    text = os.environ.get(_VARIABLE, "").strip()
    if not text:
        return DEFAULT_RANGE
    first, dash, last = text.partition("-")
    if not dash or not first.strip().isdecimal() or not last.strip().isdecimal():
        raise ValueError(f"{_VARIABLE}={text!r}: write it as first-last, for example 70000-70999")
    uids = range(int(first), int(last) + 1)
    if len(uids) < 1 or uids[0] < 1000:
        raise ValueError(
            f"{_VARIABLE}={text!r}: the range is empty or reaches into the system's own users (below 1000)"
        )
    return uids


def claim() -> PrivateUid:
    """Claim a free user id of the configured range. Raises OSError when there is none, ValueError for a bad range."""
    uids = configured_range()
    start = os.getpid() % len(uids)  # workers of one host start looking at different places
    for step in range(len(uids)):
        uid = uids[(start + step) % len(uids)]
        if _mapped(uid) and not _has_account(uid) and (held := claim_name(f"uid-{uid}")) is not None:
            return PrivateUid(uid, held)
    raise OSError(f"no free user id in {uids[0]}-{uids[-1]}: set {_VARIABLE} to a range that this container maps")


def _has_account(uid: int) -> bool:
    try:
        pwd.getpwuid(uid)
    except KeyError:
        return False
    return True


def _mapped(uid: int) -> bool:
    with open("/proc/self/uid_map", encoding="ascii") as lines:
        ranges = [[int(word) for word in line.split()] for line in lines]
    return any(inside <= uid < inside + count for inside, _outside, count in ranges)
