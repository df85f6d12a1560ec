"""A tar header whose checksum is wrong."""

from tests.hostile.parts import Upload, small_car, tar


def build() -> Upload:
    content = bytearray(tar(("agent/model.pb", small_car())))
    content[0] ^= 1
    return [("model.tar", bytes(content))]
