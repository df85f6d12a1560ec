"""A billion values for each sector."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(lidar_config={"num_values_per_sector": 1_000_000_000}))
