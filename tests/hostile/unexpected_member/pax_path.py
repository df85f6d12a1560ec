"""A pax header that renames a harmless member."""

import tarfile

from tests.hostile.parts import Upload, gzip, metadata, regular, tar_of


def build() -> Upload:
    info, content = regular("model_metadata.json", metadata())
    info.pax_headers = {"path": "../../outside"}
    return [("model.tar.gz", gzip(tar_of((info, content), format=tarfile.PAX_FORMAT)))]
