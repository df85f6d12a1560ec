"""Which of its two answers a policy process gives: float32 where it cannot tip, float64 where it can."""

from __future__ import annotations

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import CHECKED, EXACT, EXCEEDED, FAST
from paddock.network.session import load
from paddock.simulator.deciding import CHECK_EVERY, Policy

from .networks import CAMERA, HEADER

TABLE = {**HEADER, "ranges": None}
PAIR = {**HEADER, "outputs": 2, "ranges": [[-30.0, 30.0], [0.5, 4.0]]}
FRAME = np.zeros((120, 160, 1), np.uint8)


def scaled(scores, factor=1 / 3):
    """Answers the brightness of the first pixel, times ``scores``, times ``factor``: roundings in float32."""
    weights = np.zeros((120 * 160, len(scores)), np.float32)
    weights[0] = scores
    nodes = [
        helper.make_node("Cast", [CAMERA], ["picture"], to=TensorProto.FLOAT),
        helper.make_node("Flatten", ["picture"], ["row"]),
        helper.make_node("MatMul", ["row", "weights"], ["sum"]),
        helper.make_node("Mul", ["sum", "factor"], ["output"]),
    ]
    stored = {"weights": weights, "factor": np.array(factor, np.float32)}
    graph = helper.make_graph(
        nodes,
        "scaled",
        [helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, [1, 120, 160, 1])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, len(scores)])],
        [numpy_helper.from_array(array, name) for name, array in stored.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8).SerializeToString()


def policy(onnx, header=TABLE, **facts):
    return Policy(load(onnx, NetworkFacts(**facts) if facts else None), header)


def look(policy, bright):
    frame = FRAME.copy()
    frame[0, 0, 0] = bright
    return policy.answer({CAMERA: frame})


def test_a_clear_lead_is_answered_by_float32():
    car = policy(scaled([0.1, 0.2, 0.3]), bound=1e-6)
    look(car, 100)
    assert car.counts[FAST] == 1 and sum(car.counts.values()) == 1


def test_a_lead_within_the_bound_is_answered_by_float64():
    car = policy(scaled([0.1, 0.3, 0.3]), bound=1e-6)
    answer = look(car, 100)
    assert car.counts[EXACT] == 1
    assert answer.dtype == np.float32 and int(np.argmax(answer)) == 1  # the first of two equal ones


def test_a_tied_network_is_answered_by_float64_at_every_step():
    car = policy(scaled([0.2, 0.2, 0.2]), bound=1e-6)
    for bright in range(50):
        look(car, bright)
    assert car.counts == {FAST: 0, EXACT: 50, CHECKED: 0, EXCEEDED: 0}


def test_a_continuous_answer_near_a_rounding_uses_float64():
    half_a_step = 0.005 / 30.0  # between 0.00 and 0.01 degrees
    car = policy(scaled([half_a_step / 100, 0.4 / 100], factor=1.0), PAIR, bound=1e-6)
    look(car, 100)
    assert car.counts[EXACT] == 1
    look(car, 50)
    assert car.counts[FAST] == 1


def test_without_a_bound_float64_gives_every_answer():
    car = policy(scaled([0.1, 0.2, 0.3]), bound=None)
    look(car, 100)
    assert car.counts[EXACT] == 1


def test_an_unknown_bound_is_derived_at_the_start():
    car = policy(scaled([0.1, 0.2, 0.3]))
    look(car, 100)
    assert car.counts[FAST] == 1


def test_one_step_in_a_sample_is_checked():
    car = policy(scaled([0.1, 0.2, 0.3]), bound=1e-5)
    for step in range(CHECK_EVERY):
        look(car, 1 + step % 255)
    assert car.counts == {FAST: CHECK_EVERY - 1, EXACT: 0, CHECKED: 1, EXCEEDED: 0}


def test_after_a_broken_bound_every_answer_is_exact():
    car = policy(scaled([0.1, 0.2, 0.3]), bound=0.0)
    look(car, 0)  # equal scores: float64, and no error
    look(car, 77)
    for _ in range(CHECK_EVERY):
        look(car, 77)
    assert car.counts[EXCEEDED] == 1
    assert car.counts[EXACT] > CHECK_EVERY // 4
    before = car.counts[FAST]
    look(car, 78)
    assert car.counts[FAST] == before


def test_an_overflow_in_float32_stays_non_finite():
    car = policy(scaled([1e30, 1e38, 1e38], factor=1e6), bound=None)
    assert not np.isfinite(look(car, 255)).all()


def test_a_header_without_actions_gets_the_runtimes_answer():
    car = policy(scaled([0.2, 0.2, 0.2]), HEADER)
    look(car, 9)
    assert car.counts[FAST] == 1


@pytest.mark.parametrize("bright", [1, 7, 100, 255])
def test_both_answers_agree_within_the_bound(bright):
    onnx = scaled([0.11, 0.23, 0.37])
    fast, exact = policy(onnx), policy(onnx, bound=None)
    np.testing.assert_allclose(look(fast, bright), look(exact, bright), rtol=1e-6)
