"""Whether this machine computes as every other: a few golden runs, driven before a worker takes work. No Django here.

Libraries choose their code by the processor that they find, unless they are pinned (:mod:`.exact`). Whether that took
on this processor, with this C library, shows only in what a run comes to. The room of training, which has the runs,
registers how to drive them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Proof:
    """What the golden runs of a worker came to. ``differ``: the names of those that did not come to what the engine's
    table says; ``why``: what the first of them came to, in a sentence for operators; ``settled``: all were driven to
    their end, so that driving them again tells nothing new."""

    engine: str
    runs: int
    equal: int
    differ: tuple[str, ...] = ()
    why: str = ""
    settled: bool = True

    @property
    def exact(self) -> bool:
        """Whether every run came to what it must."""
        return self.equal == self.runs

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, ``exact`` among them."""
        return {**asdict(self), "differ": list(self.differ), "exact": self.exact}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Proof:
        """What :meth:`to_dict` wrote. Raises KeyError, TypeError for anything else."""
        values = {name: value for name, value in data.items() if name != "exact"}
        return cls(**{**values, "differ": tuple(values["differ"])})


_prover: Callable[[], Proof] | None = None
_proof: Proof | None = None


def register(prover: Callable[[], Proof] | None) -> None:
    """Prove with this from now on; with None nothing is proven, and nobody refuses work."""
    global _prover, _proof
    _prover, _proof = prover, None


def prove() -> Proof | None:
    """Drive the runs; once in the life of this process, unless a fault of the platform came between. None where nobody
    registered any. Takes about a second and starts sandboxed processes; raises nothing of what befalls them."""
    global _proof
    if _prover is not None and _proof is None:
        found = _prover()
        if not found.settled:
            return found
        _proof = found
    return _proof
