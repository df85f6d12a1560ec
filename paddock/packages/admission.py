"""Admits one network: converts it, checks it, rewrites it and runs three synthetic frames."""

# The site runs it in a sandboxed process (:mod:`evaluation.sandbox`), a racer at home in their own.

from dataclasses import replace
from itertools import islice

import numpy as np
from onnxruntime.capi import onnxruntime_pybind11_state as pybind

from paddock.errors import UserFault
from paddock.network.bound import PLAIN, NetworkFacts, answers_of, derive_bound, probes
from paddock.network.reference import Reference
from paddock.network.session import Refused, load

from .gate import Canonical, check_onnx
from .kinds import FORMATS
from .limits import PackageLimits
from .metadata import DISCRETE, ModelMetadata

_RUN_ERRORS = (pybind.Fail, pybind.RuntimeException, pybind.InvalidArgument, pybind.NotImplemented, RuntimeError)


def admit_network(
    kind: str,
    network: bytes | list[bytes],
    metadata: ModelMetadata,
    limits: PackageLimits,
    weights: dict[str, bytes] | None = None,
) -> Canonical:
    """Convert, gate and try out one network. Raises UserFault of the conversion and gate sections.

    ``network``: its bytes, or a list with them that is emptied to free a large network early. ``weights``: files beside
    an ONNX file, by name."""
    held = network if isinstance(network, list) else [network]
    del network
    if to_onnx := FORMATS[kind].to_onnx:
        held.append(to_onnx(held.pop(), metadata, limits))
    canonical = check_onnx(held.pop(), metadata, limits, weights)
    return replace(canonical, facts=_try_out(canonical, metadata))


class _Recorder:
    """A reference that keeps its answers, so that none is computed twice. ``answers``: those to the first frames, known
    already; ``steps``: what :meth:`Reference.steps` found."""

    def __init__(self, reference: Reference, answers: list[np.ndarray], steps: bool) -> None:
        self._reference, self._asked = reference, 0
        self.answers = answers
        self.steps = lambda feeds: steps

    def run(self, feeds: dict[str, np.ndarray]) -> np.ndarray:
        if self._asked == len(self.answers):
            self.answers.append(self._reference.run(feeds))
        self._asked += 1
        return self.answers[self._asked - 1]


def _try_out(canonical: Canonical, metadata: ModelMetadata) -> NetworkFacts:
    """Run the network on a black, a white and a noisy frame, in float32 and float64. Its facts for races."""
    try:
        network = load(canonical.onnx, canonical.facts)
    except Refused as refusal:
        raise UserFault("network_fails") from refusal
    session, reference = network.session, network.reference
    steps, first, exact = None, [], []
    for feeds in probes(canonical.inputs, PLAIN):
        try:
            if steps is None:
                answer, steps = reference.run_with_steps(feeds)
            else:
                answer = reference.run(feeds)
            first += session.run(None, feeds)
            exact.append(answer)
        except (*_RUN_ERRORS, ValueError, IndexError) as error:
            raise UserFault("network_fails") from error
        if not (np.isfinite(first[-1]).all() and np.isfinite(exact[-1]).all()):
            raise UserFault("network_non_finite")
    heard = _Recorder(reference, exact, bool(steps))
    bound = derive_bound(lambda feeds: first.pop(0) if first else session.run(None, feeds)[0], heard, canonical.inputs)
    for feeds in islice(probes(canonical.inputs), len(heard.answers), None):  # where that ended early
        heard.answers.append(reference.run(feeds))
    scores = metadata.action_space_type == DISCRETE
    answers = answers_of(heard.answers, scores=scores, about=metadata.canonical_json())
    return replace(canonical.facts, bound=bound, answers=answers)
