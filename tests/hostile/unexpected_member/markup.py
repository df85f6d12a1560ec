"""A member whose name is a trick."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("<img src=x onerror=alert(1)>.txt", b"x"))
