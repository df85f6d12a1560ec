"""Metadata of a hundred kilobytes."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata() + b" " * 100_000)
