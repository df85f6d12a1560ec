"""A policy that sees three channels: colours or stacked frames."""

from tests.hostile.parts import Upload
from tests.hostile.policies import BOX, policy


def build() -> Upload:
    return policy(observation_space={**BOX, "_shape": [3, 120, 160]})
