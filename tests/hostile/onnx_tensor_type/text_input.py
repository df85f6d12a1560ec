"""An input of texts."""

from onnx import TensorProto, helper

from tests.hostile.parts import CAMERA, Upload, network, pair


def build() -> Upload:
    return pair(network(inputs=[helper.make_tensor_value_info(CAMERA, TensorProto.STRING, [1, 120, 160, 1])]))
