"""Sectors that do not divide the beams."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(lidar_config={"num_sectors": 7}))
