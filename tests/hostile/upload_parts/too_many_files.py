"""More files than belong to any car."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return [*pair(good_network()), *((f"{number}.data", b"x") for number in range(20))]
