"""data that nests a hundred thousand lists."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


def build() -> Upload:
    return policy(data=b"[" * 100_000)
