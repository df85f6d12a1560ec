"""A bomb in a thousand members, each of them harmless."""

from tests.hostile.parts import Upload, gzip


def build() -> Upload:
    return [("model.tar.gz", gzip(bytes(1 << 16)) * 1000)]
