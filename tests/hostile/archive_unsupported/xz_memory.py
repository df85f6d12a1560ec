"""An xz file whose dictionary is larger than anything that it packs."""

import lzma
import zlib

from tests.hostile.parts import Upload, small_car, tar


def build() -> Upload:
    filters = [{"id": lzma.FILTER_LZMA2, "dict_size": 1 << 20}]
    packed = bytearray(lzma.compress(tar(("agent/model.pb", small_car())), filters=filters))
    # block header: size, flags, filter id 0x21, size of its properties, dictionary (40: 4 GiB - 1), padding, CRC32
    at = packed.index(b"\x21\x01")
    packed[at + 2] = 40
    end = 12 + 4 * (packed[12] + 1)
    packed[end - 4 : end] = zlib.crc32(packed[12 : end - 4]).to_bytes(4, "little")
    return [("model.tar.xz", bytes(packed))]
