"""A node that reads one which is not there."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("ppo_head_0/policy", "Softmax", ("ghost",)))
