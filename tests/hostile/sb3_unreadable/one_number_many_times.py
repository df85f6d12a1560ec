"""A weight of a hundred thousand million numbers, which are one number in the file."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch, weights


def build() -> Upload:
    return policy(weights(action_net__weight=torch().zeros(1).expand(100_000, 1_000_000)))
