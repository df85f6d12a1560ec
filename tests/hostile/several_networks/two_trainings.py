"""The folders of two trainings in one archive."""

from tests.hostile.parts import Upload, archive, metadata, small_car


def build() -> Upload:
    models = [(f"{folder}/model/model_1.pb", small_car() + folder.encode()) for folder in ("a", "b")]
    return archive(*models, ("model_metadata.json", metadata()))
