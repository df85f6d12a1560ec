"""A graph that ends in two loose nodes."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("a", "Relu", ("camera",)), ("b", "Tanh", ("camera",)))
