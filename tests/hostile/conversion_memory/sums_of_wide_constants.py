"""Forty bytes a node that become forty megabytes each."""

import numpy as np

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    steps = [("a", "Fill", ("size", "value")), ("s0", "Add", ("a", "a"))]
    steps += [(f"s{number}", "Add", (f"s{number - 1}", "a")) for number in range(1, 100)]
    return graph_with(
        *steps,
        ("ppo_head_0/policy", "Add", ("camera", "s99")),
        size=np.array([10_000_000], np.int32),
        value=np.float32(1),
    )
