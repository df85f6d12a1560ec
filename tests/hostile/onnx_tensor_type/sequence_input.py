"""An input that is a sequence."""

from onnx import TensorProto, helper

from tests.hostile.parts import CAMERA, Upload, network, pair


def build() -> Upload:
    return pair(network(inputs=[helper.make_tensor_sequence_value_info(CAMERA, TensorProto.FLOAT, [1])]))
