"""Truth values that are neither 0 nor 1."""

from onnx import TensorProto

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer.append(TensorProto(name="t", data_type=TensorProto.BOOL, dims=[1], raw_data=b"\x07"))
    return pair(model)
