"""A member that unpacks to far more than it says."""

from tests.hostile.parts import Upload, ZipEntry, metadata, zip_by_hand


def build() -> Upload:
    entry = ZipEntry(b"car.onnx", bytes(50 * 1024 * 1024), method=8, size=1000)
    return [("car.zip", zip_by_hand(entry, ZipEntry(b"model_metadata.json", metadata())))]
