"""One camera named a thousand times."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(sensor=["FRONT_FACING_CAMERA"] * 1000))
