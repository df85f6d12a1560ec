"""A file of no bytes."""

from tests.hostile.parts import Upload


def build() -> Upload:
    return [("model.tar.gz", b"")]
