"""An operation that no policy needs: Enter."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "Enter", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
