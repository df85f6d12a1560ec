"""Zeros without end, in xz."""

import lzma

from tests.hostile.parts import Upload, tar


def build() -> Upload:
    return [("model.tar.xz", lzma.compress(tar(("agent/model.pb", bytes(64 << 20))), preset=0))]
