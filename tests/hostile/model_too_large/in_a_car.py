"""A graph above the limit, claimed by its tar header."""

from tests.hostile.parts import Upload, regular


def build() -> Upload:
    info, _ = regular("agent/model.pb", b"")
    info.size = 41 * 1024 * 1024
    return [("model.tar", info.tobuf() + bytes(1024))]
