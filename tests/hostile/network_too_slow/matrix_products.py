"""Three hundred products with one stored matrix: seconds for every step."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair

LIMITS = {"macs": 250_000_000}


def build() -> Upload:
    nodes = [helper.make_node("Gemm", ["row", "wide"], ["v0"])]
    nodes += [helper.make_node("MatMul", [f"v{n}", "square"], [f"v{n + 1}"]) for n in range(300)]
    nodes += [helper.make_node("ReduceMean", ["v300"], ["x"], axes=[1])]
    return pair(network(nodes, {"wide": np.ones((1, 1024), np.float32), "square": np.eye(1024, dtype=np.float32)}))
