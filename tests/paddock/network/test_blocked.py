"""Weights in the runtime's own order: the one that it would have made itself."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest

from paddock.network import dense
from paddock.network.dense import ALIGNED, DOMAIN, aligned_room, arranger, in_blocks

needs_blocks = pytest.mark.skipif(arranger() is None, reason="the runtime has no blocks on this processor")


def drawn(outputs: int, inputs: int) -> np.ndarray:
    return np.random.default_rng(5).standard_normal((outputs, inputs), np.float32)


@needs_blocks
@pytest.mark.parametrize("laid", ["output by output", "input by input", "anywhere in a file"])
def test_outputs_lie_in_blocks_of_channels(laid: str) -> None:
    weights = drawn(64, 48)
    given = weights
    if laid == "input by input":
        given = np.ascontiguousarray(weights.T).T
    elif laid == "anywhere in a file":
        given = np.frombuffer(b"xyz" + weights.tobytes(), "<f4", weights.size, 3).reshape(weights.shape)
    found = in_blocks(given)
    assert found is not None and found.shape == (64, 16, 1, 3) and found.ctypes.data % ALIGNED == 0
    of_16, of_8 = (weights.reshape(64 // size, size, 48).transpose(0, 2, 1) for size in (16, 8))
    assert found.tobytes() in (of_16.tobytes(), of_8.tobytes())


def test_a_processor_without_blocks_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_args: object, **_options: object) -> None:
        raise RuntimeError(f"{DOMAIN} is not implemented")

    monkeypatch.setattr(onnxruntime, "InferenceSession", refuse)
    assert arranger.__wrapped__() is None
    monkeypatch.setattr(dense, "arranger", lambda: None)
    assert in_blocks(drawn(16, 16)) is None


def test_a_runtime_that_does_not_arrange_them_is_not_asked_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(error: Exception) -> None:
        def arrange(weights: np.ndarray, arranged: np.ndarray) -> None:
            raise error

        monkeypatch.setattr(dense, "arranger", lambda: arrange)

    fails(RuntimeError("other sizes are wanted"))
    assert in_blocks(drawn(16, 16)) is None
    fails(MemoryError())
    with pytest.raises(MemoryError):
        in_blocks(drawn(16, 16))


@pytest.mark.parametrize("dtype", [np.float32, np.int64])
def test_room_is_aligned(dtype: type) -> None:
    rooms = [aligned_room((3, 5), dtype) for _ in range(8)]
    assert all(room.ctypes.data % ALIGNED == 0 and room.shape == (3, 5) and room.dtype == dtype for room in rooms)
