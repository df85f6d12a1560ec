"""The two files that OpenVINO reads, in an archive."""

from tests.hostile.parts import Upload, archive, metadata


def build() -> Upload:
    return archive(
        ("model.xml", b'<?xml version="1.0"?><net name="car"/>'),
        ("model.bin", bytes(8)),
        ("model_metadata.json", metadata()),
    )
