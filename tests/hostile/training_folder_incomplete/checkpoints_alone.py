"""A training folder instead of the car's archive."""

from tests.hostile.parts import Upload, archive, metadata


def build() -> Upload:
    return archive(("model/.coach_checkpoint", b"1_Step-1.ckpt"), ("model_metadata.json", metadata()))
