"""A weight with two sets of values."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer[1].float_data.extend([0.0] * 5)
    return pair(model)
