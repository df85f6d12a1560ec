"""Every converter of a TensorFlow operation serves a network of the field; any other operation is refused by name."""

from __future__ import annotations

import json

import pytest

from paddock.errors import UserFault
from paddock.packages.export import frozen_graph
from paddock.packages.inputs import CAMERAS, LIDARS
from paddock.packages.metadata import parse_metadata
from paddock.packages.tensorflow import convert
from paddock.packages.tensorflow.ops_control import NOT_FROZEN
from paddock.packages.tensorflow.registry import CONVERTERS

from .coach import DEEP, MEDIUM, SHALLOW, coach_graph, metadata_dict
from .test_conversion import TRAINING_PARTS, WIDE, read, scaled_graph
from .test_export import car, without_its_mark

SENSORS = [[camera, *lidar] for camera in CAMERAS for lidar in ([], *([name] for name in LIDARS))]
DEPTHS, HEADS = (SHALLOW, MEDIUM, DEEP), ("discrete", "continuous", "sac")
# What the simulator's networks may have besides (markov/architecture: relu or tanh, batch normalisation, dropout), as
# TensorFlow 1 and 2 write it
PARTS = [{"activation": "Tanh"}, {"modern": True}, *TRAINING_PARTS.values()]
# No network of the field has these: other activations, pooling, and what stands in a frozen graph by no name of theirs
OTHERS = ("Elu", "LeakyRelu", "Sigmoid", "Abs", "Exp", "Square", "Relu6", "ZerosLike", "ReadVariableOp", "Cast", "Tile")


def converted(sensors: list[str], depth: str, head: str, **options: object) -> None:
    metadata = parse_metadata(json.dumps(metadata_dict(sensors, depth, head)).encode())
    convert(coach_graph(sensors, depth, head, middleware=[8], **options), metadata.inputs, WIDE)


def test_every_converter_is_needed_by_a_known_network(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = set()

    def recorded(op: str, converter):
        def convert_it(*arguments):
            ran.add(op)
            return converter(*arguments)

        return convert_it

    for op, converter in list(CONVERTERS.items()):
        monkeypatch.setitem(CONVERTERS, op, recorded(op, converter))
    for number, sensors in enumerate(SENSORS):
        for turn, depth in enumerate(DEPTHS):  # with each depth and each head once with every set of sensors
            converted(sensors, depth, HEADS[(number + turn) % 3])
    for parts in PARTS:
        converted(["FRONT_FACING_CAMERA", "LIDAR"], SHALLOW, "discrete", **parts)
    ours, metadata = car("trained, discrete")  # pools its pictures
    convert(without_its_mark(frozen_graph(ours.onnx, metadata)), metadata.inputs)
    assert ran == set(CONVERTERS) - set(NOT_FROZEN)


@pytest.mark.parametrize("operation", OTHERS)
def test_any_other_operation_is_refused_by_name(operation: str) -> None:
    with pytest.raises(UserFault) as fault:
        convert(coach_graph(middleware=[8], activation=operation), read({}).inputs, WIDE)
    assert fault.value.code == "graph_operation"
    assert fault.value.params["operation"] == operation


@pytest.mark.parametrize("operation", ["Div", "Maximum", "Pow"])
def test_any_other_two_input_operation_is_refused_by_name(operation: str) -> None:
    with pytest.raises(UserFault) as fault:
        convert(scaled_graph((operation, 2.0)), read({}).inputs, WIDE)
    assert fault.value.params["operation"] == operation
