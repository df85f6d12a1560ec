"""Metadata that is no UTF-8."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network(), b'{"sensor": "\xff\xfe"}')
