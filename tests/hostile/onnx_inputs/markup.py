"""An input named as markup."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.input[0].name = model.graph.node[0].input[0] = "<script>\x1b[31m"
    return pair(model)
