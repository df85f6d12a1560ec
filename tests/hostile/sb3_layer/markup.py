"""A weight whose name is markup, and endless."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch, weights


def build() -> Upload:
    return policy(weights() | {"<script>\x1b[2J" * 1000: torch().zeros(1)})
