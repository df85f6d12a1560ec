"""A policy that sees four pictures at once."""

from tests.hostile.parts import Upload
from tests.hostile.policies import BOX, policy


def build() -> Upload:
    return policy(observation_space={**BOX, "_shape": [4, 120, 160]})
