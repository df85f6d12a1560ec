"""A weight with a negative size."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer[1].dims[:] = [-1, -5]
    return pair(model)
