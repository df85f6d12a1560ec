"""A car's archive without the network."""

from tests.hostile.parts import Upload, archive, metadata


def build() -> Upload:
    return archive(("model_metadata.json", metadata()))
