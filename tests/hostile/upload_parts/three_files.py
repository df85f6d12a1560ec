"""Three files."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return [*pair(good_network()), ("reward_function.py", b"x")]
