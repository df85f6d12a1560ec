"""A continuous action space without a speed."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(
        good_network(),
        metadata(action_space_type="continuous", action_space={"steering_angle": {"low": -1, "high": 1}}),
    )
