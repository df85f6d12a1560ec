"""Many members over the same bytes, as in a non-recursive zip bomb."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    kernel = ZipEntry(b"car.onnx", good_network(), method=8)
    copies = [ZipEntry(b"car.onnx", good_network(), method=8, offset=0) for _ in range(20)]
    return [("car.zip", zip_by_hand(kernel, *copies))]
