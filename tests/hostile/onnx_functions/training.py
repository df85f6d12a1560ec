"""Training information."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.training_info.add().initialization.name = "t"
    return pair(model)
