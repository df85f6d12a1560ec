"""An operator that is not allowed: bernoulli."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Bernoulli", ["row"])
