"""An operation that no policy needs: ReadFile."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "ReadFile", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
