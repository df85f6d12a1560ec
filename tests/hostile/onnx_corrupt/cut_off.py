"""A network whose last nine bytes are missing."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network()[:-9])
