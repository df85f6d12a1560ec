"""Sequences of sequences, five thousand deep."""

from tests.hostile.parts import Upload, field, pair


def build() -> Upload:
    kind = field(1, field(1, 1))
    for _ in range(5_000):
        kind = field(4, field(1, kind))
    inner = field(11, field(1, "deep") + field(2, b"\x0f" + kind))
    return pair(b"\x08\x08" + field(8, field(2, 17)) + field(7, inner))
