"""A policy of stable-baselines3 with a weight that is no number."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch, weights


def build() -> Upload:
    return policy(weights(action_net__bias=torch().full((5,), float("nan"))))
