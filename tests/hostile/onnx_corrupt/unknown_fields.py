"""Padding in a field that the format does not have."""

from tests.hostile.parts import Upload, field, good_network, pair


def build() -> Upload:
    return pair(good_network() + field(99, bytes(1000)))
