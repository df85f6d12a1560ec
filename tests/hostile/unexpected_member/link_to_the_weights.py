"""A symbolic link in place of the file of weights."""

import tarfile

from tests.hostile.parts import Upload, metadata, outside, regular, special, tar_of


def build() -> Upload:
    (_, network), *_ = outside({"location": "car.onnx.data"}, bytes(20))
    members = [regular("car.onnx", network), regular("model_metadata.json", metadata())]
    return [("car.tar", tar_of(*members, special("car.onnx.data", tarfile.SYMTYPE, "/etc/passwd")))]
