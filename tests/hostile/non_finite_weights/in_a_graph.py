"""A broken weight in a TensorFlow graph."""

import numpy as np

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    graph = small_car()
    head = np.frombuffer(graph, np.uint8).tobytes().find(b"policy_fc/kernel")
    at = graph.find(b"\x22\xa0\x01", head) + 3
    return car(graph[:at] + np.float32(np.nan).tobytes() + graph[at + 4 :])
