"""A zip appended to a good network: two readers, two opinions."""

from tests.hostile.parts import Upload, good_network, pair, zipped


def build() -> Upload:
    return pair(good_network() + zipped(("policy.pth", b"x")))
