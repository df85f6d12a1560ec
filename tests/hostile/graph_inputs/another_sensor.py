"""A graph that reads another sensor than the metadata says."""

from tests.hostile.parts import Upload, car, coach_graph


def build() -> Upload:
    return car(coach_graph(["LEFT_CAMERA"], middleware=[8]))
