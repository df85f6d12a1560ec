"""A weight whose shape and bytes do not fit."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer[1].dims[:] = [1, 6]
    return pair(model)
