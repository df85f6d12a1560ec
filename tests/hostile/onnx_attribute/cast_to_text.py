"""A cast to strings."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Cast", ["row"], None, to=8)
