"""A policy that sees ten pictures at once."""

from tests.hostile.parts import Upload
from tests.hostile.policies import BOX, policy


def build() -> Upload:
    return policy(observation_space={**BOX, "_shape": [10, 120, 160]})
