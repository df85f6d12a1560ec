"""Pax headers without end, and no member."""

from tests.hostile.parts import Upload, regular

LIMITS = {"archive_members": 1_000}


def build() -> Upload:
    info, _content = regular("pax", b"9 mtime=1\n" + b"")
    info.type, info.size = b"x", 0
    return [("model.tar", info.tobuf() * 5_000)]
