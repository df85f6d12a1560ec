"""What a network answers to the fixed frames of :mod:`.probes`, as one number: two networks with the same drive alike,
whatever their bytes.

A file that was saved anew, a softmax more or less at its end, all scores times a constant, or weights that differ far
below what a decision hangs on change nothing of it. Networks that were trained apart differ: eight frames of scores
with two digits each do not agree by chance.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

DIGITS = 2
_LEAST = 1e-300


def answers_of(rows: Sequence[np.ndarray], *, scores: bool, about: bytes) -> str:
    """The sha-256 of the answers ``rows`` (float64, one for each frame) and of what else makes a car, ``about``.

    ``scores``: of discrete actions, of which the greatest is taken; else steering and speed.
    """
    said = np.stack([np.asarray(row, np.float64).reshape(-1) for row in rows])
    if scores:
        if (said >= 0).all() and np.allclose(said.sum(axis=1), 1.0, atol=1e-3):  # a softmax: back to its scores
            said = np.log(np.maximum(said, _LEAST))
        said = said - said.max(axis=1, keepdims=True)
        greatest = np.abs(said).max()
        said = said / greatest if greatest else said
    digits = np.rint(said * 10**DIGITS).astype("<i4")
    return hashlib.sha256(digits.tobytes() + b"\0" + about).hexdigest()
