"""An attribute that the operator does not have."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Relu", ["row"], None, evil=1)
