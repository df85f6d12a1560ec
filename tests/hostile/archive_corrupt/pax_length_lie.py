"""A pax record that claims more than the header holds."""

from tests.hostile.parts import Upload, regular, tar_of


def build() -> Upload:
    info, content = regular("pax", b"99 path=x\n")
    info.type = b"x"
    return [("model.tar", tar_of((info, content)))]
