"""A zip appended to a good graph."""

from tests.hostile.parts import Upload, car, good_network, small_car, zipped


def build() -> Upload:
    return car(small_car() + zipped(("car.onnx", good_network())))
