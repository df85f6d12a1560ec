"""Two agents in one graph."""

from tests.hostile.parts import Upload, car, coach_graph, small_car


def build() -> Upload:
    return car(small_car() + coach_graph(middleware=[8], agent="agent_1"))
