"""Each TensorFlow operation that is converted answers as OpenVINO reads it; any other is refused by its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from paddock.errors import UserFault
from paddock.packages.tensorflow import convert
from paddock.packages.tensorflow.convert import NOT_FROZEN

from .coach import coach_graph
from .graphdef import BOOL, FLOAT, INT32, Attr, GraphWriter, field
from .test_conversion import WIDE, admit, frames, openvinos, ours, read

WHOLE = Attr.dtype(INT32)
ROW = 6
Build = Callable[[GraphWriter, str], str]


def graph_of(build: Build, head: str = "ppo_head_0/policy", library: bytes = b"") -> bytes:
    """A picture's convolution and mean, a row of six; then what ``build`` makes of it; then five values."""
    writer = GraphWriter(3)
    shape = Attr.shape((-1, 120, 160, 1))
    writer.node("c/FRONT_FACING_CAMERA", "Placeholder", dtype=Attr.dtype(FLOAT), shape=shape)
    writer.const("levels", 255.0)
    value = writer.op("scaled", "RealDiv", "c/FRONT_FACING_CAMERA", "levels")
    writer.op(
        "conv", "Conv2D", value, writer.weights("k", (8, 8, 1, ROW)), strides=Attr.integers([1, 8, 8, 1]),
        padding=Attr.text("SAME"), data_format=Attr.text("NHWC"),
    )  # fmt: skip
    writer.const("axes", [1, 2], "int32")
    writer.op("row", "Mean", "conv", "axes", keep_dims=Attr.flag(False), Tidx=WHOLE)
    made = build(writer, "row")
    writer.const("width", [1, -1], "int32")
    writer.op("flat", "Reshape", made, "width", Tshape=WHOLE)
    writer.op(head, "Identity", "flat")
    return writer.build() + library


def numbers(writer: GraphWriter, name: str, values: object, dtype: str = "int32") -> str:
    return writer.const(name, values, dtype)


def one(op: str, **attributes: bytes) -> Build:
    return lambda writer, row: writer.op("made", op, row, **attributes)


def two(op: str, constant: float) -> Build:
    return lambda writer, row: writer.op("made", op, row, numbers(writer, "constant", constant, "float32"))


def sliced(begin: list[int], end: list[int], strides: list[int], /, **masks: int) -> Build:
    def build(writer: GraphWriter, row: str) -> str:
        vectors = [numbers(writer, name, value) for name, value in zip("bes", (begin, end, strides), strict=True)]
        attributes = {f"{name}_mask": Attr.integer(mask) for name, mask in masks.items()}
        return writer.node("made", "StridedSlice", [row, *vectors], T=Attr.dtype(FLOAT), Index=WHOLE, **attributes)

    return build


def reduced(op: str, keep: bool) -> Build:
    return lambda writer, row: writer.op(
        "made", op, row, numbers(writer, "axis", [-1]), keep_dims=Attr.flag(keep), Tidx=WHOLE
    )


def pooled(op: str) -> Build:
    window = Attr.integers([1, 3, 3, 1])
    return lambda writer, row: writer.op(
        "made", op, "conv", ksize=window, strides=window, padding=Attr.text("SAME"), data_format=Attr.text("NHWC")
    )


def parts_of(op: str, count: int, *inputs: str, join: list[int], **attributes: bytes) -> Build:
    """Parts of the row, joined again in another order."""

    def build(writer: GraphWriter, row: str) -> str:
        numbers(writer, "axis", 1)
        numbers(writer, "sizes", [1, -1, 2])
        given = [row if name == "row" else name for name in inputs]
        writer.node("parts", op, given, T=Attr.dtype(FLOAT), Tlen=WHOLE, **attributes)
        chosen = [f"parts:{at}" for at in join]
        if op == "Unpack":
            return writer.node(
                "made", "Pack", chosen, T=Attr.dtype(FLOAT), N=Attr.integer(len(chosen)), axis=Attr.integer(1)
            )
        return writer.node(
            "made", "ConcatV2", [*chosen, "axis"], T=Attr.dtype(FLOAT), Tidx=WHOLE, N=Attr.integer(len(chosen))
        )

    return build


def clipped(writer: GraphWriter, row: str) -> str:
    bounds = [numbers(writer, name, bound, "float32") for name, bound in (("low", -0.1), ("high", 0.1))]
    return writer.op("made", "ClipByValue", row, *bounds)


def cut(writer: GraphWriter, row: str) -> str:
    return writer.op("made", "Slice", row, numbers(writer, "from", [0, 2]), numbers(writer, "size", [-1, 3]),
                     Index=WHOLE)  # fmt: skip


def expanded(writer: GraphWriter, row: str) -> str:
    return writer.op("made", "ExpandDims", row, numbers(writer, "axis", -1), Tdim=WHOLE)


def tiled(writer: GraphWriter, row: str) -> str:
    return writer.op("made", "Tile", row, numbers(writer, "times", [1, 1]), Tmultiples=WHOLE)


def added(writer: GraphWriter, row: str) -> str:
    return writer.op("made", "AddN", row, row, row, N=Attr.integer(3))


def positive(op: str) -> Build:
    def build(writer: GraphWriter, row: str) -> str:
        squared = writer.op("squared", "Square", row)
        return writer.op("made", op, writer.op("positive", "AddV2", squared, numbers(writer, "one", 1.0, "float32")))

    return build


def dilated(writer: GraphWriter, row: str) -> str:
    return writer.op(
        "made", "Conv2D", "conv", writer.weights("k2", (3, 3, ROW, 2)), strides=Attr.integers([1, 1, 1, 1]),
        dilations=Attr.integers([1, 2, 2, 1]), padding=Attr.text("EXPLICIT"), data_format=Attr.text("NHWC"),
        explicit_paddings=Attr.integers([0, 0, 1, 2, 0, 3, 0, 0]),
    )  # fmt: skip


def filled(writer: GraphWriter, row: str) -> str:
    """A row of ones, whose size is worked out from the row's own shape."""
    writer.node("shape", "Shape", [row], T=Attr.dtype(FLOAT), out_type=WHOLE)
    ones = writer.node("filled", "Fill", ["shape", numbers(writer, "one", 1.0, "float32")], T=Attr.dtype(FLOAT),
                       index_type=WHOLE)  # fmt: skip
    return writer.op("made", "Sub", ones, row)


def ranged(writer: GraphWriter, row: str) -> str:
    writer.node("size", "Size", [row], T=Attr.dtype(FLOAT), out_type=WHOLE)
    numbers(writer, "zero", 0)
    numbers(writer, "one", 1)
    steps = writer.node("range", "Range", ["zero", "size", "one"], Tidx=WHOLE)
    return writer.op(
        "made", "Mul", row, writer.node("cast", "Cast", [steps], SrcT=WHOLE, DstT=Attr.dtype(FLOAT))
    )  # fmt: skip


def zeros_like(writer: GraphWriter, row: str) -> str:
    return writer.op("made", "Sub", writer.op("ones", "OnesLike", row), row)


def defaulted(writer: GraphWriter, row: str) -> str:
    default = writer.node("given", "PlaceholderWithDefault", [numbers(writer, "half", 0.5, "float32")],
                          dtype=Attr.dtype(FLOAT), shape=Attr.shape(()))  # fmt: skip
    return writer.op("made", "Mul", row, default)


CASES: dict[str, Build] = {
    "[..., :2]": sliced([0, 0], [0, 2], [1, 1], ellipsis=1, begin=2),
    "[..., 2:]": sliced([0, 2], [0, 0], [1, 1], ellipsis=1, end=2),
    "[:, 2:4]": sliced([0, 2], [0, 4], [1, 1], begin=1, end=1),
    "[:, -3:]": sliced([0, -3], [0, 0], [1, 1], begin=1, end=3),
    "[:, ::2]": sliced([0, 0], [0, 0], [1, 2], begin=3, end=3),
    "[0, 1:3]": sliced([0, 1], [1, 3], [1, 1], shrink_axis=1),
    "[0]": sliced([0], [1], [1], shrink_axis=1),
    "[-1, ...]": sliced([-1, 0], [0, 0], [1, 1], ellipsis=2, shrink_axis=1),
    "[..., None, 1:]": sliced([0, 0, 1], [0, 0, 0], [1, 1, 1], ellipsis=1, new_axis=2, end=4),
    "[:, 3]": sliced([0, 3], [0, 4], [1, 1], begin=1, end=1, shrink_axis=2),
    **{op: one(op) for op in ("Neg", "Abs", "Exp", "Relu", "Tanh", "Sigmoid", "Softplus", "Softsign", "Selu", "Elu")},
    **{op: one(op) for op in ("Square", "Relu6", "Softmax", "LogSoftmax", "PreventGradient", "StopGradient")},
    "LeakyRelu": one("LeakyRelu", alpha=Attr.real(0.3)),
    **{op: positive(op) for op in ("Log", "Sqrt", "Rsqrt", "Reciprocal")},
    **{op: two(op, 0.05) for op in ("Add", "AddV2", "Sub", "Mul", "RealDiv", "Div", "Maximum", "Minimum")},
    "Pow": two("Pow", 2.0),
    "SquaredDifference": two("SquaredDifference", 0.3),
    **{f"{op}, {keep}": reduced(op, keep) for op in ("Mean", "Sum", "Max", "Min") for keep in (True, False)},
    **{op: pooled(op) for op in ("MaxPool", "AvgPool")},
    "Split": parts_of("Split", 3, "axis", "row", join=[2, 0], num_split=Attr.integer(3)),
    "SplitV": parts_of("SplitV", 3, "row", "sizes", "axis", join=[2, 1], num_split=Attr.integer(3)),
    "Unpack": parts_of("Unpack", 6, "row", join=[5, 3, 1], num=Attr.integer(6), axis=Attr.integer(1)),
    "ClipByValue": clipped,
    "Slice": cut,
    "ExpandDims": expanded,
    "Tile": tiled,
    "AddN": added,
    "dilations": dilated,
    "Fill": filled,
    "Range": ranged,
    "OnesLike": zeros_like,
    "PlaceholderWithDefault": defaulted,
}  # fmt: skip


def same_width(build: Build) -> Build:
    """Five values of any number of them, so that every case is a network of one action space."""

    def whole(writer: GraphWriter, row: str) -> str:
        made = build(writer, row)
        numbers(writer, "a row", [1, -1])
        flat = writer.op("a flat row", "Reshape", made, "a row", Tshape=WHOLE)
        off = Attr.flag(False)
        width = WIDTHS.setdefault(id(build), _width_of(build))
        return writer.op("five", "MatMul", flat, writer.weights("m", (width, 5)), transpose_a=off, transpose_b=off)

    return whole


WIDTHS: dict[int, int] = {}


def _width_of(build: Build) -> int:
    """How many values ``build`` makes, as the gate counts them."""
    try:
        admit(graph_of(build), read({"actions": 5}), WIDE)
    except UserFault as fault:
        if fault.code == "onnx_output":
            return int(
                np.prod([int(size) for size in str(fault.params["found"]).split("[")[1].split("]")[0].split(",")])
            )
        raise
    return 5


@pytest.mark.parametrize("case", CASES)
def test_an_operation_answers_as_openvino_reads_it(case: str, tmp_path: Path) -> None:
    graph, metadata = graph_of(same_width(CASES[case])), read({"actions": 5})
    feed = frames(metadata)
    expected = openvinos(graph, feed, tmp_path)
    assert np.ptp(expected) > 1e-4, "a network that always answers the same proves nothing"
    np.testing.assert_allclose(ours(admit(graph, metadata), feed), expected, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("head", ["ppo_head_0", "sac_policy_head_0"])
@pytest.mark.parametrize("last", ["policy", "policy_mean"])
def test_a_head_is_known_by_both_of_its_names(head: str, last: str) -> None:
    kind = "sac" if head.startswith("sac") else "continuous"
    metadata = read({"head": kind})
    feed = frames(metadata)
    answers = {
        name: ours(admit(graph_of(sliced([0, 0], [0, 2], [1, 1], ellipsis=1, begin=2), name), metadata), feed)
        for name in (f"a/{head}/{last}", "ppo_head_0/policy")
    }
    named, plain = answers.values()
    np.testing.assert_allclose(named, np.tanh(plain) if kind == "sac" else plain, atol=1e-6)


@pytest.mark.parametrize("operation", ["Cumsum", "LRN", "ReverseV2", "RandomUniform", "Erf"])
def test_any_other_operation_is_refused_by_name(operation: str) -> None:
    with pytest.raises(UserFault) as fault:
        convert(coach_graph(middleware=[8], activation=operation), read({}).inputs, WIDE)
    assert fault.value.code == "graph_operation"
    assert fault.value.params["operation"] == operation


@pytest.mark.parametrize("operation", NOT_FROZEN)
def test_a_variable_is_refused_as_not_frozen(operation: str) -> None:
    with pytest.raises(UserFault) as fault:
        admit(graph_of(lambda writer, row: writer.op("made", operation, row)), read({}))
    assert fault.value.code == "graph_not_frozen"


BROKEN: dict[str, Build] = {
    "two ellipses": sliced([0, 0], [0, 0], [1, 1], ellipsis=3),
    "more axes than there are": sliced([0, 0, 0], [0, 1, 1], [1, 1, 1]),
    "an index beyond the axis": sliced([0, 9], [1, 10], [1, 1], shrink_axis=2, begin=1, end=1),
    "a stride of zero": sliced([0, 0], [1, 2], [1, 0]),
    "vectors of other lengths": sliced([0, 0], [1], [1, 1]),
    "parts that do not fit": parts_of("Split", 4, "axis", "row", join=[0], num_split=Attr.integer(4)),
    "two axes for one": lambda writer, row: writer.op("made", "ExpandDims", row, numbers(writer, "axis", [0, 1])),
    "a function that is not there": lambda writer, row: writer.node(
        "made", "PartitionedCall", [row], f=field(10, field(1, "missing"))
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_node_that_contradicts_itself_is_refused(case: str) -> None:
    with pytest.raises(UserFault) as fault:
        admit(graph_of(BROKEN[case]), read({}))
    assert fault.value.code == "graph_invalid"


# --- functions, as TensorFlow 2 writes branches


def function(name: str, nodes: list[bytes], result: str) -> bytes:
    """A FunctionDef of one argument ``x`` and one result ``y``."""
    argument, output = (field(1, letter) + field(3, 1) for letter in "xy")
    signature = field(1, name) + field(2, argument) + field(3, output)
    return field(1, signature) + b"".join(field(3, node) for node in nodes) + field(4, field(1, "y") + field(2, result))


def library(*functions: bytes) -> bytes:
    return field(2, b"".join(field(1, one) for one in functions))


def call(name: str, op: str, *inputs: str, **functions: str) -> bytes:
    attributes = {key: field(10, field(1, value)) for key, value in functions.items()}
    body = field(1, name) + field(2, op) + b"".join(field(3, source) for source in inputs)
    return body + b"".join(field(5, field(1, key) + field(2, value)) for key, value in attributes.items())


def branched(flag: bool) -> Build:
    def build(writer: GraphWriter, row: str) -> str:
        writer.const("flag", flag, "bool")
        functions = {"then_branch": field(10, field(1, "doubled")), "else_branch": field(10, field(1, "kept"))}
        return writer.node("made", "If", ["flag", row], Tcond=Attr.dtype(BOOL), **functions)

    return build


def test_the_branch_that_is_taken_is_converted_and_the_other_never_read() -> None:
    add = field(1, "sum") + field(2, "AddV2") + field(3, "x") + field(3, "x")
    random = field(1, "noise") + field(2, "RandomUniform") + field(3, "x")
    metadata = read({"actions": ROW})
    feed = frames(metadata)
    plain = ours(admit(graph_of(lambda writer, row: row), metadata), feed)
    both = library(function("doubled", [add], "sum:z:0"), function("kept", [], "x"))
    np.testing.assert_allclose(ours(admit(graph_of(branched(True), library=both), metadata), feed), plain * 2)
    strange = library(function("doubled", [random], "noise:output:0"), function("kept", [], "x"))
    np.testing.assert_array_equal(ours(admit(graph_of(branched(False), library=strange), metadata), feed), plain)
    with pytest.raises(UserFault) as fault:
        admit(graph_of(branched(True), library=strange), metadata)
    assert fault.value.params["operation"] == "RandomUniform"


def test_a_function_that_calls_itself_is_refused() -> None:
    endless = library(function("doubled", [call("again", "PartitionedCall", "x", f="doubled")], "again:output:0"))
    with pytest.raises(UserFault) as fault:
        admit(graph_of(branched(True), library=endless), read({"actions": ROW}))
    assert fault.value.code == "graph_operation"


def test_functions_that_call_each_other_many_times_are_bounded() -> None:
    """Four calls in each of twelve functions would be sixteen million."""
    functions = []
    for level in range(12):
        calls = [call(f"c{at}", "PartitionedCall", "x", f=f"f{level + 1}") for at in range(4)]
        total = field(1, "sum") + field(2, "AddN") + b"".join(field(3, f"c{at}:output:0") for at in range(4))
        functions.append(function("doubled" if not level else f"f{level}", [*calls, total], "sum:sum:0"))
    functions.append(function("f12", [], "x"))
    with pytest.raises(UserFault) as fault:
        admit(graph_of(branched(True), library=library(*functions)), read({"actions": ROW}))
    assert fault.value.code == "graph_too_big"


def floats(writer: GraphWriter, name: str) -> str:
    return writer.op(f"{name}_float", "Cast", name, DstT=Attr.dtype(FLOAT))


def huge_range(writer: GraphWriter, row: str) -> str:
    ends = [numbers(writer, name, value, "int64") for name, value in (("a", -(2**63)), ("b", 2**63 - 1), ("d", 1))]
    writer.op("range", "Range", *ends)
    return writer.op("made", "AddV2", row, floats(writer, "range"))


def negative_power(writer: GraphWriter, row: str) -> str:
    writer.op("power", "Pow", numbers(writer, "base", 2), numbers(writer, "exponent", -1))
    return writer.op("made", "AddV2", row, floats(writer, "power"))


def huge_fill(writer: GraphWriter, row: str) -> str:
    writer.op("fill", "Fill", numbers(writer, "sizes", [0, 2**31 - 1, 2**31 - 1]), numbers(writer, "v", 1.0, "float32"))
    return writer.op("made", "AddV2", row, "fill")


def negative_flag(writer: GraphWriter, row: str) -> str:
    writer.op("negative", "Neg", numbers(writer, "flags", [True], "bool"))
    return writer.op("made", "AddV2", row, floats(writer, "negative"))


def difference_of_flags(writer: GraphWriter, row: str) -> str:
    writer.op("difference", "Sub", *(numbers(writer, name, [True], "bool") for name in "ab"))
    return writer.op("made", "AddV2", row, floats(writer, "difference"))


def nothing_passed_on(writer: GraphWriter, row: str) -> str:
    return writer.node("made", "IdentityN", [])


@pytest.mark.parametrize(
    "build", [huge_range, negative_power, huge_fill, negative_flag, difference_of_flags, nothing_passed_on]
)
def test_known_values_that_numpy_cannot_compute_make_the_graph_invalid(build: Build) -> None:
    with pytest.raises(UserFault) as fault:
        admit(graph_of(build), read({"actions": ROW}))
    assert fault.value.code == "graph_invalid"
