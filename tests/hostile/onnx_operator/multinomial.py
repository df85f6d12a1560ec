"""An operator that is not allowed: multinomial."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Multinomial", ["row"], None, sample_size=5)
