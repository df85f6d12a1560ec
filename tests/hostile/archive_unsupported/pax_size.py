"""A pax header that changes a member's size."""

from tests.hostile.parts import Upload, regular, tar_of


def build() -> Upload:
    record = b"20 size=99999999999\n"
    info, content = regular("pax", record)
    info.type = b"x"
    return [("model.tar", tar_of((info, content), regular("agent/model.pb", b"x")))]
