"""Two graphs in one file, which a library would merge."""

from tests.hostile.parts import Upload, field, network, pair


def build() -> Upload:
    model = network()
    return pair(model.SerializeToString() + field(7, model.graph.SerializeToString()))
