"""SAC with a list of actions."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(training_algorithm="sac"))
