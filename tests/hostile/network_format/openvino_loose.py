"""The two files that OpenVINO reads, as they are."""

from tests.hostile.parts import Upload, metadata


def build() -> Upload:
    return [
        ("model.xml", b'<?xml version="1.0"?>\n<net name="car"/>'),
        ("model.bin", bytes(8)),
        ("model_metadata.json", metadata()),
    ]
