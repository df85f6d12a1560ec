"""An operator that is not allowed: no name."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("", ["row"])
