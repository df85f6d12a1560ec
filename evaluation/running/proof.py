"""Proves that this machine computes as every other, by a few golden runs before a worker takes work. No Django.

Libraries choose their code by the processor, unless :mod:`paddock.exact` pins them; only a run shows whether that
worked. The room of training registers how to drive the runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from threading import Lock
from typing import Any


@dataclass(frozen=True)
class Proof:
    """The results of a worker's golden runs. ``differ``: the runs that differ from the engine's table; ``why``: the
    first difference, for operators; ``settled``: all were driven to their end."""

    engine: str
    runs: int
    equal: int
    differ: tuple[str, ...] = ()
    why: str = ""
    settled: bool = True

    @property
    def exact(self) -> bool:
        return self.equal == self.runs

    def to_dict(self) -> dict[str, object]:
        """Plain JSON values, ``exact`` among them."""
        return {**asdict(self), "differ": list(self.differ), "exact": self.exact}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Proof:
        """What :meth:`to_dict` wrote. Raises KeyError, TypeError for anything else."""
        values = {name: value for name, value in data.items() if name != "exact"}
        return cls(**{**values, "differ": tuple(values["differ"])})


_prover: Callable[[], Proof] | None = None
_proof: Proof | None = None
_proving = Lock()  # each thread of a worker would drive the runs at its start


def register(prover: Callable[[], Proof] | None) -> None:
    """Prove with this from now on; with None nothing is proven, and nobody refuses work."""
    global _prover, _proof
    _prover, _proof = prover, None


def prove() -> Proof | None:
    """Drive the runs, once per process unless a platform fault interrupted them. None where none are registered. Takes
    about a second and starts sandboxed processes."""
    global _proof
    with _proving:
        if _prover is not None and _proof is None:
            found = _prover()
            if not found.settled:
                return found
            _proof = found
        return _proof
