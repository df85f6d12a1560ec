"""Zeros without end, in bzip2."""

import bz2

from tests.hostile.parts import Upload, tar


def build() -> Upload:
    return [("model.tar.bz2", bz2.compress(tar(("agent/model.pb", bytes(64 << 20)))))]
