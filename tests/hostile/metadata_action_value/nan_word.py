"""A speed that spells NaN."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(action_space=[{"steering_angle": 0, "speed": "nan"}]))
