"""Weights of something else than a policy."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch


def build() -> Upload:
    return policy({"encoder.weight": torch().zeros(2, 2)})
