"""Two weights of one name."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer.append(model.graph.initializer[1])
    return pair(model)
