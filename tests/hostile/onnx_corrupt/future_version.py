"""A version of the format that does not exist yet."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.ir_version = 1 << 40
    return pair(model)
