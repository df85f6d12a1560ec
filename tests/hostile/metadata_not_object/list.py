"""A list instead of an object."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network(), b"[1, 2]")
