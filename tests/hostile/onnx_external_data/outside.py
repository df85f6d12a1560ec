"""Weights in a file outside."""

from onnx import TensorProto

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    tensor = TensorProto(name="w", data_type=1, dims=[4], data_location=TensorProto.EXTERNAL)
    for key, value in {"location": "../../../../etc/passwd"}.items():
        entry = tensor.external_data.add()
        entry.key, entry.value = key, value
    model.graph.initializer.append(tensor)
    return pair(model)
