"""An operation that no policy needs: While."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "While", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
