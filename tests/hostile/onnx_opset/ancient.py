"""An operator set from before 2019."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network(opset=7))
