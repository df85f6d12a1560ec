"""A good network whose metadata file is empty."""

from tests.hostile.parts import Upload, good_network


def build() -> Upload:
    return [("car.onnx", good_network()), ("model_metadata.json", b"")]
