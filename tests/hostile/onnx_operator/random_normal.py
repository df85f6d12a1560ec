"""An operator that is not allowed: random normal."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("RandomNormalLike", ["row"])
