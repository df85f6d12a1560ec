"""An operator that is not allowed: optional."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Optional", ["row"])
