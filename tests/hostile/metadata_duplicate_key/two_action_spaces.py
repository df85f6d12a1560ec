"""Two action spaces: readers disagree about which counts."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), b'{"action_space": [], ' + metadata()[1:])
