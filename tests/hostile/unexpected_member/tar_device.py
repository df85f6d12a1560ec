"""A tar member that is no plain file: device."""

import tarfile

from tests.hostile.parts import Upload, special, with_files


def build() -> Upload:
    return with_files(special("agent/model.pb", tarfile.CHRTYPE, ""))
