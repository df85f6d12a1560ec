"""A weight of type bfloat16."""

from onnx import TensorProto

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer.append(TensorProto(name="w", data_type=TensorProto.BFLOAT16, dims=[2], raw_data=bytes(16)))
    return pair(model)
