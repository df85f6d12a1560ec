"""An operation that no policy needs: EvilOp."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "EvilOp", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
