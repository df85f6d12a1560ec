"""A network that does not read the lidar that its metadata names."""

from tests.hostile.parts import Upload, metadata, network, pair


def build() -> Upload:
    return pair(network(), metadata(sensor=["FRONT_FACING_CAMERA", "LIDAR"]))
