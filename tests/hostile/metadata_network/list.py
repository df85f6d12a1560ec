"""A network that is a list."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(neural_network=[["x"]]))
