"""A range whose low is above its high."""

from tests.hostile.parts import Upload, good_network, metadata, pair


def build() -> Upload:
    return pair(
        good_network(),
        metadata(
            action_space_type="continuous",
            action_space={"steering_angle": {"low": 30, "high": -30}, "speed": {"low": 1, "high": 4}},
        ),
    )
