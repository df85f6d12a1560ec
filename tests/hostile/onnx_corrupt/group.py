"""A field of the old group kind."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network() + b"\x7b\x7c")
