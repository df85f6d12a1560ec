"""Metadata without a network."""

from tests.hostile.parts import Upload, metadata


def build() -> Upload:
    return [("model_metadata.json", metadata())]
