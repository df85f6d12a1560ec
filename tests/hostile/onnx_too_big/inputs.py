"""Six hundred inputs."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network(inputs=[helper.make_tensor_value_info(f"i{n}", 1, [1]) for n in range(600)]))
