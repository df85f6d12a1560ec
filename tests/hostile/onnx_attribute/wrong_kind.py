"""An axis that is a text."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Softmax", ["row"], None, axis="0")
