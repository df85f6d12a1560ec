"""A clipping distance below the sensor's range."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(lidar_config={"clipping_dist": 0}))
