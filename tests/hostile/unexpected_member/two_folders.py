"""Network and metadata in two different folders."""

from tests.hostile.parts import Upload, archive, metadata, small_car


def build() -> Upload:
    return archive(("a/agent/model.pb", small_car()), ("b/model_metadata.json", metadata()))
