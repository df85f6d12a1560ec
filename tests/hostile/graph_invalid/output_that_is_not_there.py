"""An input that names output 999 of a node."""

from tests.hostile.parts import CAMERA, Upload, graph_with


def build() -> Upload:
    return graph_with(("ppo_head_0/policy", "Softmax", (f"camera/{CAMERA}:999",)))
