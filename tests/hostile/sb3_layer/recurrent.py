"""A policy with a memory."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch, weights


def build() -> Upload:
    return policy(weights(lstm_actor__weight_hh_l0=torch().zeros(4, 4)))
