"""The measurements of an admission: test frames, the bound of float32 errors, and the fingerprint of the answers."""

# The rounding errors of a network's sums depend on the order of the sums, which differs between processors, but their
# distribution does not. The admission takes the greatest difference over all outputs and :data:`COUNT` frames with more
# contrast than a camera has, times :data:`MARGIN`. ``python -m benchmarks.processors`` shows how much of the margin was
# ever used. Every run also checks a sample of its steps (:class:`paddock.simulator.deciding.Policy`).

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypedDict

import numpy as np

PLAIN = 3  # the first of them: only least values, only greatest, a fixed noise
COUNT = 8

Input = tuple[str, str, tuple[int, ...]]  # name, "uint8" or "float32", shape
MARGIN = 8.0
_DIGITS, _LEAST = 2, 1e-300  # of the fingerprint: digits of a score, least probability
_FLOOR = 2.0**-20  # of the greatest answer, sixteen units in its last place: the least bound
_COARSE = 2.0**-8  # of the greatest answer: the greatest bound


class FactsDocument(TypedDict):
    """:class:`NetworkFacts` in JSON."""

    bound: float | None
    shapes: dict[str, list[int]]
    answers: str


@dataclass(frozen=True)
class NetworkFacts:
    """The results of a network's admission.

    ``bound``: the greatest difference of a float32 answer from the float64 one rounded to float32; None for a network
    that always needs the exact way: with an operator that makes a step out of a slope, or with large errors.
    ``shapes``: of the values round its large dense layers (:mod:`.dense`). ``answers``: the fingerprint of its answers
    (:func:`answers_of`), or empty.
    """

    bound: float | None = None
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    answers: str = ""

    def to_dict(self) -> FactsDocument:
        shapes = {name: list(shape) for name, shape in self.shapes.items()}
        return {"bound": self.bound, "shapes": shapes, "answers": self.answers}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> NetworkFacts:
        """The inverse of :meth:`to_dict`. Raises KeyError, TypeError, ValueError for anything else."""
        bound = data["bound"]
        if bound is not None and not 0.0 <= float(bound) < float("inf"):
            raise ValueError("a bound must be a number, or none")
        shapes = {str(name): tuple(int(size) for size in shape) for name, shape in data["shapes"].items()}
        answers = data.get("answers", "")
        if answers and not re.fullmatch("[0-9a-f]{64}", answers):
            raise ValueError("answers must be a sha-256, or none")
        return cls(None if bound is None else float(bound), shapes, answers)


class Exact(Protocol):
    """A :class:`.reference.Reference`, or a wrapper of one."""

    @property
    def steps(self) -> Callable[[dict[str, np.ndarray]], bool]: ...
    def run(self, feeds: dict[str, np.ndarray], /) -> np.ndarray: ...


def derive_bound(
    answer: Callable[[dict[str, np.ndarray]], np.ndarray], reference: Exact, inputs: Sequence[Input]
) -> float | None:
    """The bound of a network, or None, see :class:`NetworkFacts`. ``answer``: the runtime's, by its feeds."""
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
    """A float64 answer as one row of float32."""
    with np.errstate(over="ignore"):
        return exact.reshape(-1).astype(np.float32)


def probes(inputs: Sequence[Input], count: int = COUNT) -> Iterator[dict[str, np.ndarray]]:
    """Readings for each input by name, in its dtype and shape; ``count`` at most :data:`COUNT`.

    A picture (four dimensions) has values from 0 to 255, a lidar's row from 0 to 1.
    """
    for frame in range(count):
        yield {name: _reading(dtype, shape, 255 if len(shape) == 4 else 1, frame) for name, dtype, shape in inputs}


def _reading(dtype: str, shape: tuple[int, ...], top: int, frame: int) -> np.ndarray:
    if frame < 2:
        return np.full(shape, frame * top, dtype)
    # Knuth's multiplicative hash: the sandbox's lock forbids the import of numpy.random
    places = np.arange(np.prod(shape), dtype=np.uint64)
    scattered = ((places * 2654435761 + frame * 40503) & 0xFFFFFFFF) >> 16
    noise = (scattered % (top + 1)).astype(np.float64)
    if frame == 2:
        values = noise
    elif frame == 3:  # dark with little contrast
        values = top * 0.2 + noise * 0.1
    elif frame == 4:  # bright with little contrast
        values = top * 0.7 + noise * 0.1
    elif frame == 5:  # from dark to bright
        values = top * (places / max(1, places.size - 1))
    elif frame == 6:  # blocks
        values = top * ((places // 8 + places // (8 * 160)) % 2).astype(np.float64)
    else:  # a few bright lines on grey
        values = np.where(places % 37 < 3, top, top * 0.25)
    if np.dtype(dtype).kind == "u":
        values = np.floor(values)
    return values.astype(dtype).reshape(shape)


def answers_of(rows: Sequence[np.ndarray], *, scores: bool, about: bytes) -> str:
    """A sha-256 of the answers ``rows`` (float64, one for each frame of :func:`probes`) and of ``about``, the other
    parts of the car. Equal for networks that drive alike: saved again, with a softmax, with scaled scores, or with
    weights that differ far below the precision of a decision. ``scores``: of discrete actions."""
    values = np.stack([np.asarray(row, np.float64).reshape(-1) for row in rows])
    if scores:
        if (values >= 0).all() and np.allclose(values.sum(axis=1), 1.0, atol=1e-3):  # a softmax: back to its scores
            values = np.log(np.maximum(values, _LEAST))
        values = values - values.max(axis=1, keepdims=True)
        greatest = np.abs(values).max()
        values = values / greatest if greatest else values
    digits = np.rint(values * 10**_DIGITS).astype("<i4")
    return hashlib.sha256(digits.tobytes() + b"\0" + about).hexdigest()
