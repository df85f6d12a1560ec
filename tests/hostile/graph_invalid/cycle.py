"""Two nodes that wait for each other."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(
        ("a", "Add", ("b", "camera")), ("b", "Add", ("a", "camera")), ("ppo_head_0/policy", "Softmax", ("a",))
    )
