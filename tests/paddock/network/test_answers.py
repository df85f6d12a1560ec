"""The same car by what it answers: however its file was written, and not by chance."""

from __future__ import annotations

import numpy as np
import pytest
from onnx import helper, numpy_helper

from paddock.network.bound import answers_of
from paddock.packages.admission import admit_network
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from tests.hostile.parts import metadata, network

META = parse_metadata(metadata())
ROWS = [np.array([[0.3, -2.0, 1.1, 0.0, 4.0]]), np.array([[1.0, 0.2, -0.7, 3.0, -1.0]])]


def said(model) -> str:
    return admit_network("onnx", model.SerializeToString(), META, DEFAULT_LIMITS).facts.answers


def changed(by: float):
    """The network of the tests with every weight moved by that share of itself."""
    model = network()
    for weight in model.graph.initializer:
        array = numpy_helper.to_array(weight)
        if array.dtype == np.float32:
            moved = array * (1 + np.float32(by) * np.sign(np.sin(np.arange(array.size))).reshape(array.shape))
            weight.CopyFrom(numpy_helper.from_array(moved.astype(np.float32), weight.name))
    return model


def test_a_barely_changed_network_is_the_same_car():
    assert said(changed(0.0)) == said(network()) and len(said(network())) == 64
    assert said(changed(1e-6)) == said(network())
    assert said(changed(0.1)) != said(network())


def test_a_final_softmax_does_not_make_another_car():
    model = network()
    output = model.graph.output[0].name
    for node in model.graph.node:
        node.output[:] = ["before" if name == output else name for name in node.output]
    model.graph.node.append(helper.make_node("Softmax", ["before"], [output], axis=1))
    assert said(model) == said(network())


@pytest.mark.parametrize(
    "rows",
    [
        [row * 3 for row in ROWS],
        [row + 7 for row in ROWS],
        [np.exp(row) / np.exp(row).sum() for row in ROWS],
        [row * (1 + 1e-7) for row in ROWS],
    ],
    ids=["other temperature", "all moved", "softmax", "last digits"],
)
def test_scores_are_compared_in_proportion(rows):
    assert answers_of(rows, scores=True, about=b"x") == answers_of(ROWS, scores=True, about=b"x")


def test_other_answers_or_actions_make_another_car():
    turned = [row[:, ::-1] for row in ROWS]
    assert answers_of(turned, scores=True, about=b"x") != answers_of(ROWS, scores=True, about=b"x")
    assert answers_of(ROWS, scores=True, about=b"y") != answers_of(ROWS, scores=True, about=b"x")
    assert answers_of([row * 3 for row in ROWS], scores=False, about=b"x") != answers_of(ROWS, scores=False, about=b"x")
