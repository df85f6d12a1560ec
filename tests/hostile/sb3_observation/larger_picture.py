"""A policy that sees a larger picture."""

from tests.hostile.parts import Upload
from tests.hostile.policies import BOX, policy


def build() -> Upload:
    return policy(observation_space={**BOX, "_shape": [1, 240, 320]})
