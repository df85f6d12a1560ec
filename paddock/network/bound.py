"""How far a network's float32 answer may be from its float64 one, and so when it decides.

Rounding errors of a network's sums are small steps to either side, some 2^-24 of the partial sums each, in an order
that differs from processor to processor. Their size hangs on the network and on its frames, not on the order: all
orders draw from the same distribution. It is measured where the network is admitted, as the greatest difference over
all outputs and :data:`.probes.COUNT` frames whose contrast is beyond a camera's, and multiplied by :data:`MARGIN`.
``python -m benchmarks.processors`` tells how much of that was ever used. A sample of the steps of every run is checked
besides (:class:`paddock.simulator.deciding.Policy`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from .probes import Input, probes

MARGIN = 8.0
_FLOOR = 2.0**-20  # of the greatest answer: sixteen units in its last place, where the probes showed less
_COARSE = 2.0**-8  # of the greatest answer: errors so large are those of a network that computes badly


@dataclass(frozen=True)
class NetworkFacts:
    """What the admission of a network found out, kept with it.

    ``bound``: no float32 answer is farther than this from the float64 one rounded to float32; None where the network
    always goes the exact way, because it has an operator that makes a step out of a slope, or its errors are too large.
    ``shapes``: of the values round its large dense layers, which are optimised when it is loaded (:mod:`.dense`).
    ``answers``: what it says to the frames of :mod:`.probes` (:mod:`.answers`); empty where that was not asked.
    """

    bound: float | None = None
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    answers: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        shapes = {name: list(shape) for name, shape in self.shapes.items()}
        return {"bound": self.bound, "shapes": shapes, "answers": self.answers}

    @classmethod
    def from_dict(cls, said: Mapping[str, Any]) -> NetworkFacts:
        """The inverse of :meth:`to_dict`. Raises KeyError, TypeError, ValueError for anything else."""
        bound = said["bound"]
        if bound is not None and not 0.0 <= float(bound) < float("inf"):
            raise ValueError("a bound must be a number, or none")
        shapes = {str(name): tuple(int(size) for size in shape) for name, shape in said["shapes"].items()}
        answers = said.get("answers", "")
        if answers and not re.fullmatch("[0-9a-f]{64}", answers):
            raise ValueError("answers must be a sha-256, or none")
        return cls(None if bound is None else float(bound), shapes, answers)


class Exact(Protocol):
    """What answers exactly: a :class:`.reference.Reference`, or one that somebody listens to."""

    @property
    def steps(self) -> Callable[[dict[str, np.ndarray]], bool]: ...
    def run(self, feeds: dict[str, np.ndarray], /) -> np.ndarray: ...


def derive_bound(
    answer: Callable[[dict[str, np.ndarray]], np.ndarray], reference: Exact, inputs: Sequence[Input]
) -> float | None:
    """The bound of a network; None where it has to go the exact way always. ``answer``: the runtime's, by its feeds."""
    worst = greatest = 0.0
    for frame, feeds in enumerate(probes(inputs)):
        if frame == 0 and reference.steps(feeds):
            return None
        exact = rounded(reference.run(feeds)).astype(np.float64)
        error = np.abs(np.asarray(answer(feeds), np.float64).reshape(-1) - exact).max()
        if not np.isfinite(error):
            return None
        worst, greatest = max(worst, float(error)), max(greatest, float(np.abs(exact).max()))
    bound = max(MARGIN * worst, _FLOOR * greatest)
    return bound if bound <= _COARSE * greatest else None


def rounded(exact: np.ndarray) -> np.ndarray:
    """The float64 answer as it decides: one row of float32."""
    with np.errstate(over="ignore"):
        return exact.reshape(-1).astype(np.float32)
