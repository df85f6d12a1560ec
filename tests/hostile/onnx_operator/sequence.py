"""An operator that is not allowed: sequence."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("SequenceConstruct", ["row"])
