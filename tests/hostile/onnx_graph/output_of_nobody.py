"""An output that nothing makes."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network(outputs=[helper.make_tensor_value_info("ghost", TensorProto.FLOAT, [1, 5])]))
