"""Forty bytes a node that become forty megabytes each."""

import numpy as np

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    steps = [("a", "Add", ("column", "row")), ("s0", "Add", ("a", "a"))]
    steps += [(f"s{number}", "Add", (f"s{number - 1}", "a")) for number in range(1, 100)]
    return graph_with(
        *steps,
        ("ppo_head_0/policy", "Add", ("camera", "s99")),
        column=np.ones((3200, 1), np.float32),
        row=np.ones((1, 3200), np.float32),
    )
