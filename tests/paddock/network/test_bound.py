"""How far float32 may be from float64 is found out at admission, and no network that computes badly gets a bound."""

from __future__ import annotations

import json

import numpy as np
import pytest
from onnx import TensorProto, helper

from evaluation.convert_process import admit_network
from paddock.errors import UserFault
from paddock.network.bound import MARGIN, Facts, derive_bound
from paddock.network.probes import COUNT, probes
from paddock.network.session import load
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from tests.hostile.parts import metadata, network

META = parse_metadata(metadata())
op = helper.make_node


def admitted(*nodes, **weights):
    """A network from ``row``, the mean of the picture, to ``x``, of which scores are made."""
    return admit_network("onnx", network(list(nodes), weights).SerializeToString(), META, DEFAULT_LIMITS)


def test_a_plain_network_has_a_bound_beyond_what_any_frame_showed():
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
def test_one_that_rounds_on_its_way_always_goes_the_exact_way(operator):
    assert admitted(op(operator, ["row"], ["x"])).facts.bound is None


def test_one_that_compares_on_its_way_does_too():
    step = [op("Greater", ["row", "half"], ["is"]), op("Cast", ["is"], ["x"], to=TensorProto.FLOAT)]
    assert admitted(*step, half=np.array([[127.3]], np.float32)).facts.bound is None


def test_one_whose_errors_are_as_large_as_its_answers_does_too():
    """A small number plus and minus a great one: float32 keeps nothing of it."""
    lost = [op("Add", ["row", "great"], ["sum"]), op("Sub", ["sum", "great"], ["x"])]
    assert admitted(*lost, great=np.array([[3e9]], np.float32)).facts.bound is None


def test_one_that_is_finite_in_float32_only_is_refused():
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


def test_answers_that_are_not_finite_have_no_bound():
    canonical = admit_network("onnx", network().SerializeToString(), META, DEFAULT_LIMITS)
    loaded = load(canonical.onnx)
    assert derive_bound(lambda feeds: np.full((1, 5), np.nan), loaded.reference, loaded.inputs) is None


def test_facts_travel_as_json():
    facts = Facts(1e-6, {"_v1": (1, 3, 4, 5)})
    assert Facts.from_dict(json.loads(json.dumps(facts.to_dict()))) == facts
    assert Facts.from_dict(json.loads(json.dumps(Facts().to_dict()))) == Facts()


@pytest.mark.parametrize("said", [{}, {"bound": -1.0, "shapes": {}}, {"bound": "a", "shapes": {}}, {"bound": 1e400}])
def test_what_are_no_facts_is_refused(said):
    with pytest.raises((KeyError, ValueError, TypeError)):
        Facts.from_dict(said)
