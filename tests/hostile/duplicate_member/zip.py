"""Two members of one name: readers disagree about which counts."""

from tests.hostile.parts import Upload, ZipEntry, good_network, metadata, zip_by_hand


def build() -> Upload:
    entries = [ZipEntry(b"car.onnx", good_network()), ZipEntry(b"car.onnx", b"other")]
    return [("car.zip", zip_by_hand(*entries, ZipEntry(b"model_metadata.json", metadata())))]
