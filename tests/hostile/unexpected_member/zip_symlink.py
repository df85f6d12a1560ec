"""A zip member that is a symbolic link."""

import zipfile

from tests.hostile.parts import Upload, metadata, zipped


def build() -> Upload:
    info = zipfile.ZipInfo("car.onnx")
    info.create_system, info.external_attr = 3, 0o120777 << 16
    return [("car.zip", zipped((info, b"/etc/passwd"), ("model_metadata.json", metadata())))]
