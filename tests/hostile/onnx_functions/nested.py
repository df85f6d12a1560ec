"""Functions that call each other in doubling depth: checkers hang on it."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    functions = [
        helper.make_function(
            "f",
            f"F{n}",
            ["a"],
            ["b"],
            [
                helper.make_node(f"F{n - 1}", ["a"], ["c"], domain="f"),
                helper.make_node(f"F{n - 1}", ["c"], ["b"], domain="f"),
            ]
            if n
            else [helper.make_node("Abs", ["a"], ["b"])],
            [helper.make_opsetid("", 17), helper.make_opsetid("f", 1)],
        )
        for n in range(25)
    ]
    return pair(network([helper.make_node("F24", ["row"], ["x"], domain="f")], domains=("f",), functions=functions))
