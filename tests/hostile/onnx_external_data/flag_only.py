"""External data without saying where."""

from onnx import TensorProto

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer[1].data_location = TensorProto.EXTERNAL
    return pair(model)
