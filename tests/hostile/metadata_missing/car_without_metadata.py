"""A car's archive without metadata."""

from tests.hostile.parts import Upload, archive, small_car


def build() -> Upload:
    return archive(("agent/model.pb", small_car()))
