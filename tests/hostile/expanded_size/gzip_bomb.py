"""A gigabyte of zeros in a gzip of four megabytes."""

import zlib

from tests.hostile.parts import Upload, regular


def build() -> Upload:
    engine = zlib.compressobj(1, zlib.DEFLATED, 16 + zlib.MAX_WBITS)
    info, _ = regular("._padding", b"")
    info.size = 1 << 30
    packed = engine.compress(info.tobuf())
    for _ in range(1024):
        packed += engine.compress(bytes(1 << 20))
    return [("model.tar.gz", packed + engine.flush())]
