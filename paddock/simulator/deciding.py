"""Runs a network as a driver: sensor readings in, action values out, equal on every processor."""

# A model's input has the sensor's name and its layout (``[1, H, W, C]``) or channels first (``[1, C, H, W]``); the
# observation is cast to the input's dtype, not scaled. With stacked frames (VecFrameStack of stable-baselines3) it
# reads the last observations of its run, joined along the channels, the newest last, zeros before the first. The site
# runs it in a sandboxed process (:mod:`evaluation.sandbox.policy_process`).

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from paddock.network.bound import derive_bound, rounded
from paddock.network.policy_wire import (
    CHECKED,
    EXACT,
    EXCEEDED,
    FAST,
    FIRST,
    STEP,
    WAYS,
    Buffer,
    PolicyHeader,
    observations_in,
    reply_buffer,
    request_buffer,
)
from paddock.network.session import Loaded, Refused, memory_or, plain

from .action import is_clear

_DTYPES = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
}

CHECK_EVERY, _CHECK_AT = 1024, 64  # steps


class Policy:
    """A network whose buffers are allocated once, and whose actions are the same on every processor.

    Fill ``request`` (:mod:`paddock.network.policy_wire`), call :meth:`run`, read ``reply``. ``memory``: holds the
    observations in place of the request. ``counts``: of the steps so far, by the ways of
    :data:`paddock.network.policy_wire.WAYS`. Stacked observations are those since the last step
    :data:`paddock.network.policy_wire.FIRST`; with :meth:`answer` an object serves one run. Raises Refused.
    """

    def __init__(self, network: Loaded, header: PolicyHeader, memory: Buffer | None = None) -> None:
        self._network, self._session = network, network.session
        self._binding = self._session.io_binding()
        self._feeds: list[tuple[np.ndarray, np.ndarray]] = []
        self._named: dict[str, np.ndarray] = {}
        self._shifts: list[tuple[np.ndarray, np.ndarray]] = []  # of stacked inputs: where to, where from
        if memory is None:
            self.request, self._observations = request_buffer(header)
        else:
            self.request, self._observations = bytearray(STEP.size), observations_in(header, memory)
        self.reply, self._action = reply_buffer(header)
        self._bind_inputs(self._observations, int(header.get("frames", 1)))
        self._bind_output()
        self._judges, self._ranges = "ranges" in header, header.get("ranges")
        self._bound = self._known_bound() if self._judges else None
        self._forget()
        self._steps = 0
        self.counts = dict.fromkeys(WAYS, 0)

    def run(self) -> int:
        """One inference; its way. Raises MemoryError and the runtime's exceptions.

        float32 answers where no error within the bound can change the action, else float64. Once in
        :data:`CHECK_EVERY` steps both are computed; if the bound does not hold, float64 answers from then on."""
        if self._shifts:
            self._shift()
        for feed, observation in self._feeds:
            np.copyto(feed, observation, casting="unsafe")
        way = self._answered()
        self.counts[way] += 1
        return way

    def answer(self, readings: Mapping[str, np.ndarray]) -> np.ndarray:
        """One step for a referee in this process: readings in, the float32 row out, a fresh array."""
        for name, place in self._observations.items():
            np.copyto(place, readings[name])
        self.run()
        return self._action.copy()

    def _shift(self) -> None:
        if STEP.unpack_from(self.request)[0] == FIRST:
            self._forget()
        for older, later in self._shifts:
            older[...] = later

    def _forget(self) -> None:
        for feed in self._named.values():
            feed.fill(0)

    def _answered(self) -> int:
        if not self._judges:
            self._run_fast()
            return FAST
        step, self._steps = self._steps, self._steps + 1
        if self._bound is None:
            self._action[...] = self._exact()
            return EXACT
        self._run_fast()
        clear = is_clear(self._action.tolist(), self._bound, self._ranges)
        if clear and step % CHECK_EVERY != _CHECK_AT:
            return FAST
        exact = self._exact()
        exceeded = float(np.abs(exact.astype(np.float64) - self._action).max()) > self._bound
        self._action[...] = exact
        if exceeded:
            self._bound = None
            return EXCEEDED
        return CHECKED if clear else EXACT

    def _run_fast(self) -> None:
        try:
            self._session.run_with_iobinding(self._binding)
        except Exception as error:
            raise memory_or(error, error) from None
        np.copyto(self._action, self._output, casting="unsafe")

    def _exact(self) -> np.ndarray:
        return rounded(self._network.reference.run(self._named))

    def _known_bound(self) -> float | None:
        """The bound of the admission; derived now for a network from before there were bounds."""
        if self._network.facts is not None:
            return self._network.facts.bound

        def answer(feeds: dict[str, np.ndarray]) -> np.ndarray:
            for name, feed in self._named.items():
                np.copyto(feed, feeds[name])
            self._run_fast()
            return self._action.copy()

        return derive_bound(answer, self._network.reference, self._network.inputs)

    def _bind_inputs(self, observations: dict[str, np.ndarray], frames: int) -> None:
        inputs = {node.name: node for node in self._session.get_inputs()}
        if set(inputs) != set(observations):
            raise Refused(plain(f"its inputs are {sorted(inputs)} where the sensors are {sorted(observations)}"))
        for name, observation in observations.items():
            node = inputs[name]
            feed: np.ndarray = np.zeros(_static(node), _dtype(node))
            seen, axis = _layout(observation, feed.shape, frames)
            one = seen.shape[axis]
            older, newest = np.split(feed, [(frames - 1) * one], axis)
            self._feeds.append((newest, seen))
            if frames > 1:
                self._shifts.append((older, np.split(feed, [one], axis)[1]))
            self._named[name] = feed
            self._binding.bind_input(node.name, "cpu", 0, feed.dtype.type, feed.shape, feed.ctypes.data)

    def _bind_output(self) -> None:
        (*others, node) = self._session.get_outputs()
        shape = _static(node)
        if others or math.prod(shape) != self._action.size:
            raise Refused(f"its output is not one row of {self._action.size} values")
        output: np.ndarray = np.zeros(shape, _dtype(node))
        self._binding.bind_output(node.name, "cpu", 0, output.dtype.type, output.shape, output.ctypes.data)
        self._output = output.reshape(-1)


def _static(node: Any) -> tuple[int, ...]:
    if not all(isinstance(size, int) and size > 0 for size in node.shape):
        raise Refused(f"{plain(node.name)} has no fixed shape")
    return tuple(node.shape)


def _dtype(node: Any) -> type:
    if node.type not in _DTYPES:
        raise Refused(f"{node.type} is not a type that it may have")
    return _DTYPES[node.type]


def _layout(observation: np.ndarray, shape: tuple[int, ...], frames: int) -> tuple[np.ndarray, int]:
    """A view of ``observation`` (H, W, C or a row) in the layout of the model's input, and the axis along which
    ``frames`` of them are joined."""
    *rest, last = observation.shape
    if shape == (1, *rest, frames * last):
        return observation[np.newaxis], len(rest) + 1
    if observation.ndim == 3 and shape == (1, frames * last, *rest):
        return observation.transpose(2, 0, 1)[np.newaxis], 1
    several = f" {frames} times" if frames > 1 else ""
    raise Refused(f"an input of shape {list(shape)} does not take a sensor of shape {list(observation.shape)}{several}")
