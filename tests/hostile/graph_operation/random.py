"""An operation that no policy needs: RandomStandardNormal."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("n", "RandomStandardNormal", ("camera",)), ("ppo_head_0/policy", "Softmax", ("n",)))
