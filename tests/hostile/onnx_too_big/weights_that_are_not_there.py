"""A weight that claims 2^62 values in 32 bytes."""

from onnx import TensorProto

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer.append(TensorProto(name="w", data_type=1, dims=[1 << 31, 1 << 31], raw_data=bytes(32)))
    return pair(model)
