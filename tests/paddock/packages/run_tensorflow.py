"""Answers of a frozen graph, by TensorFlow itself and by TFLite, as newer cars drive it: ``graph feeds.npz out.npz``.

Run by a Python that finds TensorFlow; knows nothing of Paddock.
"""

import os
import sys

os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"

import numpy as np
import tensorflow

v1 = tensorflow.compat.v1


def main(graph_file: str, feeds_file: str, out_file: str) -> None:
    """Write the answers as ``tensorflow`` and ``tflite``."""
    graph_def = v1.GraphDef()
    with open(graph_file, "rb") as file:
        graph_def.ParseFromString(file.read())
    with np.load(feeds_file) as feeds:
        given = {node.name: feeds[node.name.rsplit("/", 1)[-1]] for node in graph_def.node if node.op == "Placeholder"}
    (output,) = [node.name for node in graph_def.node if node.name.endswith("head_0/policy")]
    with tensorflow.Graph().as_default() as graph:
        v1.import_graph_def(graph_def, name="")
        with v1.Session(graph=graph) as session:
            answer = session.run(f"{output}:0", {f"{name}:0": feed for name, feed in given.items()})
    shapes = {name: list(feed.shape) for name, feed in given.items()}
    converter = v1.lite.TFLiteConverter.from_frozen_graph(graph_file, list(given), [output], shapes)
    lite = tensorflow.lite.Interpreter(model_content=converter.convert())
    lite.allocate_tensors()
    for detail in lite.get_input_details():
        lite.set_tensor(detail["index"], given[detail["name"].split(":")[0]])
    lite.invoke()
    np.savez(out_file, tensorflow=answer, tflite=lite.get_tensor(lite.get_output_details()[0]["index"]))


if __name__ == "__main__":
    main(*sys.argv[1:])
