"""A height that is not fixed."""

from onnx import TensorProto, helper

from tests.hostile.parts import CAMERA, Upload, network, pair


def build() -> Upload:
    return pair(network(inputs=[helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, [1, "height", 160, 1])]))
