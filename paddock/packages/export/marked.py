"""A network as a frozen graph that carries, in a mark, which network it was.

A graph says what a network computes, but not in which of many equal forms the network was: bytes or floats as input,
layers of which shape. The mark says it, without the large weights, which stand in the graph; the reader that believes
it only when it may is :mod:`paddock.packages.tensorflow.ours`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.packages.inputs import InputSpec

from .graphdef import Part, Written, policy_node, write_graph
from .lower import lower
from .plain import Step
from .policy import Head, finish

FORM = 1  # the next one when the same network is written as another graph: see the test of the exported bytes
_LARGE = 64  # numbers; smaller weights are in the mark itself


def exported(network: CanonicalNetwork, specs: Mapping[str, InputSpec], head: Head) -> list[Part]:
    """The network as a frozen GraphDef, in parts to be joined. Raises UserFault ``export_operator``."""
    written = write_graph(finish(lower(network, dict(specs)), head), head)
    return [*written.parts, policy_node(written, head, _mark(network, written, head))]


def _mark(network: CanonicalNetwork, written: Written, head: Head) -> bytes:
    kept = {
        name: place
        for name, place in written.weights.items()
        if name in network.weights and network.weights[name].size > _LARGE and can_be_undone(place[1])
    }
    said = {
        "form": FORM,
        "sac": head.is_sac,
        "scores": head.scores,
        "weights": {
            name: [node, [[step.kind, *step.numbers] for step in steps]] for name, (node, steps) in kept.items()
        },
    }
    line = json.dumps(said, sort_keys=True, separators=(",", ":")).encode()
    return line + b"\n" + write_model(network, frozenset(kept))


def can_be_undone(steps: Sequence[Step]) -> bool:
    """Whether nothing is reshaped whose axes were ordered anew before: what a reshape began with is not written down,
    and need not be while it only says how the same bytes are read."""
    kinds = [step.kind for step in steps]
    return kinds == sorted(kinds)
