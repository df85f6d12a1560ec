"""A policy.pth that ends in its midst."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, saved, weights


def build() -> Upload:
    return policy(saved(weights())[:5000])
