"""Members compressed with LZMA."""

import zipfile

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(method=zipfile.ZIP_LZMA)
