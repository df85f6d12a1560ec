"""A tar size in the binary form, negative."""

from tests.hostile.parts import Upload, regular


def build() -> Upload:
    info, _ = regular("agent/model.pb", b"")
    header = bytearray(info.tobuf())
    header[124:136] = b"\xff" * 12
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\0 " % sum(header)
    return [("model.tar", bytes(header) + bytes(1024))]
