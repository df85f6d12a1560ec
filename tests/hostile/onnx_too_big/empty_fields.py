"""Four hundred thousand empty fields in one node."""

from tests.hostile.parts import Upload, field, pair


def build() -> Upload:
    return pair(b"\x08\x08" + field(8, field(2, 17)) + field(7, field(1, field(4, "Abs") + field(1, b"") * 400_000)))
