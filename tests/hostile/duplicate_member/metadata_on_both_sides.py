"""Two different files of metadata, neither nearer to the network."""

from tests.hostile.parts import Upload, archive, metadata, small_car


def build() -> Upload:
    files = [(f"{folder}/model_metadata.json", metadata(version=number)) for number, folder in ((3, "b"), (4, "c"))]
    return archive(("a/model.pb", small_car()), *files)
