"""Infinity is no JSON."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata().replace(b"2.0", b"-Infinity"))
