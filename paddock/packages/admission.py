"""The admission of one network: convert if need be, gate, write anew, run three synthetic frames.

The site does it in a sandboxed process (:mod:`evaluation.convert_process`), a racer at home in their own.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
from onnxruntime.capi import onnxruntime_pybind11_state as pybind

from paddock.errors import UserFault
from paddock.network.answers import answers_of
from paddock.network.bound import NetworkFacts, derive_bound
from paddock.network.probes import PLAIN, probes
from paddock.network.reference import Reference
from paddock.network.session import Refused, load

from .gate import Canonical, check_onnx
from .kinds import TENSORFLOW
from .limits import PackageLimits
from .metadata import DISCRETE, ModelMetadata
from .tensorflow import convert

_RUN_ERRORS = (pybind.Fail, pybind.RuntimeException, pybind.InvalidArgument, pybind.NotImplemented, RuntimeError)


def admit_network(
    kind: str,
    network: bytes | list[bytes],
    metadata: ModelMetadata,
    limits: PackageLimits,
    weights: dict[str, bytes] | None = None,
) -> Canonical:
    """Convert, gate and try out one network. Raises UserFault of the conversion and gate sections.

    ``network``: its bytes, or a list of just these, which is emptied so that a large one is not held for longer than
    it is read. ``weights``: files beside an ONNX file, by name.
    """
    held = network if isinstance(network, list) else [network]
    del network
    if kind == TENSORFLOW:
        held.append(convert(held.pop(), metadata.inputs, limits))
    canonical = check_onnx(held.pop(), metadata, limits, weights)
    return replace(canonical, facts=_try_out(canonical, metadata))


class _Heard:
    """A reference that keeps what it answered, so that nothing is asked twice."""

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self.answers: list[np.ndarray] = []
        self.steps = reference.steps

    def run(self, feeds: dict[str, np.ndarray]) -> np.ndarray:
        self.answers.append(self._reference.run(feeds))
        return self.answers[-1]


def _try_out(canonical: Canonical, metadata: ModelMetadata) -> NetworkFacts:
    """Run the network on a black, a white and a noisy frame: it must run, and answer finite values, in float32 and in
    float64. What is to be known of it when it races."""
    try:
        network = load(canonical.onnx, canonical.facts)
    except Refused as refusal:
        raise UserFault("network_fails") from refusal
    session, reference = network.session, network.reference
    for feeds in probes(canonical.inputs, PLAIN):
        try:
            (answer,) = session.run(None, feeds)
            exact = reference.run(feeds)
        except (*_RUN_ERRORS, ValueError, IndexError) as error:
            raise UserFault("network_fails") from error
        if not (np.isfinite(answer).all() and np.isfinite(exact).all()):
            raise UserFault("network_non_finite")
    heard = _Heard(reference)
    bound = derive_bound(lambda feeds: session.run(None, feeds)[0], heard, canonical.inputs)
    for feeds in islice(probes(canonical.inputs), len(heard.answers), None):  # where that ended early
        heard.run(feeds)
    scores = metadata.action_space_type == DISCRETE
    answers = answers_of(heard.answers, scores=scores, about=metadata.canonical_json())
    return replace(canonical.facts, bound=bound, answers=answers)
