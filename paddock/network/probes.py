"""Frames that a network is tried with before it races: the most that a sensor may deliver, the least, and between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

PLAIN = 3  # the first of them: only least values, only greatest, a fixed noise
COUNT = 8

Input = tuple[str, str, tuple[int, ...]]  # name, "uint8" or "float32", shape


def probes(inputs: Sequence[Input], count: int = COUNT) -> Iterator[dict[str, np.ndarray]]:
    """Readings for each input by name, in its dtype and shape; ``count`` at most :data:`COUNT`.

    A picture (four dimensions) has values from 0 to 255, a lidar's row from 0 to 1.
    """
    for frame in range(count):
        yield {name: _reading(dtype, shape, 255 if len(shape) == 4 else 1, frame) for name, dtype, shape in inputs}


def _reading(dtype: str, shape: tuple[int, ...], top: int, frame: int) -> np.ndarray:
    if frame < 2:
        return np.full(shape, frame * top, dtype)
    # Knuth's multiplicative hash (numpy.random would be imported only now, which the lock forbids)
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
