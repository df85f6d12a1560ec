"""A policy of ten actions for a car of five."""

from tests.hostile.parts import Upload
from tests.hostile.policies import PIXELS, policy, torch, weights


def build() -> Upload:
    return policy(weights(action_net__weight=torch().zeros(10, PIXELS), action_net__bias=torch().zeros(10)))
