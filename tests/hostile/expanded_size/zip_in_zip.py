"""A bomb in an archive within an archive."""

from tests.hostile.parts import Upload, gzip, tar, zipped


def build() -> Upload:
    return [("car.zip", zipped(("car.tar.gz", gzip(tar(("agent/model.pb", bytes(64 << 20)))))))]
