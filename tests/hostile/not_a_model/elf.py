"""Not a network at all: elf."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"\x7fELF\x02\x01\x01" + bytes(100))
