"""A loop whose rounds the picture decides."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    body = helper.make_graph(
        [helper.make_node("Identity", ["c"], ["d"]), helper.make_node("Abs", ["v"], ["w"])],
        "body",
        [helper.make_tensor_value_info(n, t, []) for n, t in (("i", 7), ("c", 9))]
        + [helper.make_tensor_value_info("v", 1, [1, 1])],
        [helper.make_tensor_value_info("d", 9, []), helper.make_tensor_value_info("w", 1, [1, 1])],
    )
    return pair(
        network(
            [
                helper.make_node("Cast", ["mean"], ["whole"], to=TensorProto.INT64),
                helper.make_node("Squeeze", ["whole"], ["rounds"]),
                helper.make_node("Loop", ["rounds", "", "row"], ["x"], body=body),
            ]
        )
    )
