"""A size that hangs on the picture."""

import numpy as np
from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    nodes = [
        helper.make_node("Concat", ["one4", "mean4"], ["wide"], axis=0),
        helper.make_node("Cast", ["wide"], ["size"], to=TensorProto.INT64),
        helper.make_node("Resize", ["picture", "", "", "size"], ["large"]),
        helper.make_node("ReduceMean", ["large"], ["little"], axes=[0, 1, 2, 3], keepdims=0),
        helper.make_node("Mul", ["little", "row"], ["x"]),
    ]
    front = [helper.make_node("Identity", ["mean"], ["mean4"])]
    return pair(network([*front, *nodes], {"one4": np.ones(3, np.float32)}))
