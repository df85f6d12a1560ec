"""One byte more than an upload may have."""

from tests.hostile.parts import Upload


def build() -> Upload:
    return [("model.tar.gz", bytes(64 * 1024 * 1024 + 1))]
