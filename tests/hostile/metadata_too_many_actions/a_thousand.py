"""A thousand actions."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(good_network(), metadata(action_space=[{"steering_angle": 0, "speed": 1}] * 1000))
