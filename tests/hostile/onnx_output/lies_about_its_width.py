"""An output that claims to fit and does not."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, metadata, metadata_dict, network, pair


def build() -> Upload:
    model = network(outputs=[helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, 6])])
    return pair(model, metadata(**metadata_dict(actions=6)))
