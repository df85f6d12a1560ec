"""No output."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    del model.graph.output[:]
    return pair(model)
