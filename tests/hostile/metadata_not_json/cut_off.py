"""Metadata that broke off."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata()[:-5])
