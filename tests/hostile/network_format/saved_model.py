"""A SavedModel of TensorFlow."""

from tests.hostile.parts import Upload, archive, metadata


def build() -> Upload:
    return archive(
        ("car/saved_model.pb", b"\x08\x01"),
        ("car/variables/variables.index", b"x"),
        ("model_metadata.json", metadata()),
    )
