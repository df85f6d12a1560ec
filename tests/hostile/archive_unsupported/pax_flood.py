"""A pax header of a megabyte."""

from tests.hostile.parts import Upload, gzip, regular, tar_of


def build() -> Upload:
    info, content = regular("pax", b"1000000 comment=" + b"a" * 999_983 + b"\n")
    info.type = b"x"
    return [("model.tar.gz", gzip(tar_of((info, content))))]
