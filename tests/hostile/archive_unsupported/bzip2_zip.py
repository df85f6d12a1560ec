"""Members compressed with bzip2."""

import zipfile

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(method=zipfile.ZIP_BZIP2)
