"""How far float32 may be from float64 is found out at admission, and no network that computes badly gets a bound."""

from __future__ import annotations

import json

import numpy as np
import pytest
from onnx import TensorProto, helper

from paddock.errors import UserFault
from paddock.network.bound import COUNT, MARGIN, NetworkFacts, derive_bound, probes
from paddock.network.session import load
from paddock.packages.admission import admit_network
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from tests.hostile.parts import metadata, network

META = parse_metadata(metadata())
op = helper.make_node


def admitted(*nodes, **weights):
    """A network from ``row``, the mean of the picture, to ``x``, of which scores are made."""
    return admit_network("onnx", network(list(nodes), weights).SerializeToString(), META, DEFAULT_LIMITS)


def test_a_plain_networks_bound_exceeds_every_observed_error():
    canonical = admit_network("onnx", network().SerializeToString(), META, DEFAULT_LIMITS)
    loaded = load(canonical.onnx, canonical.facts)
    errors = [
        np.abs(loaded.session.run(None, feeds)[0] - loaded.reference.run(feeds)).max()
        for feeds in probes(canonical.inputs)
    ]
    assert len(errors) == COUNT
    assert canonical.facts.bound >= MARGIN * max(errors) * 0.9
    assert canonical.facts.bound < 1e-2


@pytest.mark.parametrize("operator", ["Floor", "Round", "Sign"])
def test_a_rounding_network_gets_no_bound(operator):
    assert admitted(op(operator, ["row"], ["x"])).facts.bound is None


def test_a_comparing_network_gets_no_bound():
    step = [op("Greater", ["row", "half"], ["is"]), op("Cast", ["is"], ["x"], to=TensorProto.FLOAT)]
    assert admitted(*step, half=np.array([[127.3]], np.float32)).facts.bound is None


def test_a_network_with_errors_as_large_as_answers_gets_no_bound():
    """A small number plus and minus a great one: float32 keeps nothing of it."""
    lost = [op("Add", ["row", "great"], ["sum"]), op("Sub", ["sum", "great"], ["x"])]
    assert admitted(*lost, great=np.array([[3e9]], np.float32)).facts.bound is None


def test_a_network_finite_only_in_float32_is_refused():
    """(y + 3e9) - 3e9 - y is 0 for float64 and -y for float32; of which the reciprocal is taken."""
    nodes = [
        op("Add", ["row", "small"], ["y"]),
        op("Add", ["y", "great"], ["sum"]),
        op("Sub", ["sum", "great"], ["back"]),
        op("Sub", ["back", "y"], ["nothing"]),
        op("Reciprocal", ["nothing"], ["x"]),
    ]
    weights = {"great": np.array([[3e9]], np.float32), "small": np.array([[1.0]], np.float32)}
    with pytest.raises(UserFault) as caught:
        admitted(*nodes, **weights)
    assert caught.value.code == "network_non_finite"


def test_non_finite_answers_have_no_bound():
    canonical = admit_network("onnx", network().SerializeToString(), META, DEFAULT_LIMITS)
    loaded = load(canonical.onnx)
    assert derive_bound(lambda feeds: np.full((1, 5), np.nan), loaded.reference, loaded.inputs) is None


def test_facts_survive_json():
    facts = NetworkFacts(1e-6, {"_v1": (1, 3, 4, 5)})
    assert NetworkFacts.from_dict(json.loads(json.dumps(facts.to_dict()))) == facts
    assert NetworkFacts.from_dict(json.loads(json.dumps(NetworkFacts().to_dict()))) == NetworkFacts()


@pytest.mark.parametrize("said", [{}, {"bound": -1.0, "shapes": {}}, {"bound": "a", "shapes": {}}, {"bound": 1e400}])
def test_malformed_facts_are_refused(said):
    with pytest.raises((KeyError, ValueError, TypeError)):
        NetworkFacts.from_dict(said)
