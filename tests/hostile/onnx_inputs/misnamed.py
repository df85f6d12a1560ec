"""An input that is not named as its sensor."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.input[0].name = "input"
    model.graph.node[0].input[0] = "input"
    return pair(model)
