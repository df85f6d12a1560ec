"""Two spellings of one iteration, with different networks."""

from tests.hostile.parts import Upload, archive, metadata, small_car


def build() -> Upload:
    models = [(f"model/model_{number}.pb", small_car() + number.encode()) for number in ("7", "07")]
    return archive(*models, ("model/model_metadata.json", metadata()))
