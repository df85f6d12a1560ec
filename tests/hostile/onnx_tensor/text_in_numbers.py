"""A weight with texts as well."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.initializer[1].string_data.append(b"x")
    return pair(model)
