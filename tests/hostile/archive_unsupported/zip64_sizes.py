"""Sizes that point to a zip64 field which lies."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    return [("car.zip", zip_by_hand(ZipEntry(b"car.onnx", good_network(), size=0xFFFFFFFF, packed=0xFFFFFFFF)))]
