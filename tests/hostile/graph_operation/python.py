"""An operation that no policy needs: PyFunc."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "PyFunc", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
