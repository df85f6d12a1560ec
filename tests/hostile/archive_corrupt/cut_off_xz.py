"""An xz file that broke off."""

import lzma

from tests.hostile.parts import Upload, small_car, tar


def build() -> Upload:
    return [("model.tar.xz", lzma.compress(tar(("agent/model.pb", small_car())))[:-100])]
