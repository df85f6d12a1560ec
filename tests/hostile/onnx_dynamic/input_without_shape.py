"""An input without any shape."""

from onnx import TensorProto, helper

from tests.hostile.parts import CAMERA, Upload, network, pair


def build() -> Upload:
    return pair(network(inputs=[helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, None)]))
