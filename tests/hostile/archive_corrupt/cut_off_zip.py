"""A zip that broke off."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    ((name, content),) = good_zip()
    return [(name, content[:-30])]
