"""An unknown network."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(neural_network="TRANSFORMER"))
