"""More stacked frames than a network may read."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(frame_stack=9))
