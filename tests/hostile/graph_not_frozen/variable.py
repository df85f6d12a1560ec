"""A training graph whose weights are elsewhere."""

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(("v", "VariableV2", ()), ("ppo_head_0/policy", "Add", ("camera", "v")))
