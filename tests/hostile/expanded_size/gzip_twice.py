"""A bomb that hides in a second layer."""

from tests.hostile.parts import Upload, gzip, tar


def build() -> Upload:
    return [("model.tar.gz", gzip(gzip(tar(("agent/model.pb", bytes(64 << 20))))))]
