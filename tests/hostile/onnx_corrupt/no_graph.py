"""Only a version."""

from tests.hostile.parts import Upload, field, pair


def build() -> Upload:
    return pair(b"\x08\x08" + field(8, field(2, 17)))
