"""Five hundred tensors that all lie in one place of a small file."""

import onnx
from onnx import TensorProto

from tests.hostile.parts import Upload, metadata, network

LIMITS = {"model_bytes": 8 << 20}


def build() -> Upload:
    model = network()
    for number in range(20):
        tensor = TensorProto(name=f"w{number}", data_type=1, dims=[1 << 18], data_location=TensorProto.EXTERNAL)
        tensor.external_data.add(key="location", value="car.onnx.data")
        model.graph.initializer.append(tensor)
    assert isinstance(model, onnx.ModelProto)
    return [
        ("car.onnx", model.SerializeToString()),
        ("car.onnx.data", bytes(1 << 20)),
        ("model_metadata.json", metadata()),
    ]
