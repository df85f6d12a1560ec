"""A lidar configuration that is a list."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(lidar_config=[1]))
