"""A graph above the limit, claimed by its tar header."""

from tests.hostile.parts import Upload, regular

LIMITS = {"model_bytes": 40 << 20}


def build() -> Upload:
    info, _ = regular("agent/model.pb", b"")
    info.size = 41 << 20
    return [("model.tar", info.tobuf() + bytes(1024))]
