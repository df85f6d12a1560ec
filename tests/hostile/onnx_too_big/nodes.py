"""Two hundred thousand nodes."""

from tests.hostile.parts import Upload, field, pair


def build() -> Upload:
    node = field(1, field(1, "x") + field(2, "x") + field(4, "Abs"))
    return pair(b"\x08\x08" + field(8, field(2, 17)) + field(7, node * 200_000))
