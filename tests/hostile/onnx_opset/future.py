"""An operator set that does not exist yet."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network(opset=999))
