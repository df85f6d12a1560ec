"""Large dense layers race as convolutions, which the runtime computes faster: the same model with the same answers.

They become that where the network is loaded: what a model is, and so its identity, knows nothing of it.
"""

from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import helper

from paddock.errors import UserFault
from paddock.network import dense as dense_module
from paddock.network import session
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.network.dense import CHANNELS, LEAST_OUTPUTS, LEAST_WEIGHTS, arranger, dense_as_convolutions
from paddock.network.session import load
from paddock.packages.admission import admit_network
from paddock.packages.gate import Canonical, check_onnx
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import identity, parse_metadata
from paddock.packages.read import ONNX
from tests.hostile.parts import CAMERA, metadata, network

META = parse_metadata(metadata())
FEATURES = 128
VALUES = 16 * 29 * 39  # what a convolution of 16 filters of 8 x 8 in steps of 4 makes of 120 x 160
FRAME = 120 * 160
RANDOM = np.random.default_rng(11)
op = helper.make_node


def drawn(*shape: int) -> np.ndarray:
    return RANDOM.standard_normal(shape, np.float32) / np.float32(np.sqrt(np.prod(shape[1:])))


def dense(row: str = "flat", made: str = "made", weights: str = "large", **attributes: object) -> onnx.NodeProto:
    return op("Gemm", [row, weights, "large_bias"], [made], **{"transB": 1, **attributes})


SCALED = op("Mul", ["picture", "scale"], ["scaled"])
RAW = [SCALED, op("Flatten", ["scaled"], ["flat"])]
SEEN = [
    SCALED,
    op("Transpose", ["scaled"], ["planes"], perm=[0, 3, 1, 2]),
    op("Conv", ["planes", "filters"], ["seen"], kernel_shape=[8, 8], strides=[4, 4]),
    op("Relu", ["seen"], ["on"]),
]
FLAT = [*SEEN, op("Flatten", ["on"], ["flat"])]
LAST = [*SEEN, op("Transpose", ["on"], ["last"], perm=[0, 2, 3, 1]), op("Reshape", ["last", "as_row"], ["flat"])]
HEAD = op("Gemm", ["found", "head", "bias"], ["scores"])
END = [op("Relu", ["made"], ["found"]), HEAD]
WEIGHTS = {
    "scale": np.array(1 / 255, np.float32),
    "filters": drawn(16, 1, 8, 8),
    "as_row": np.array([1, VALUES]),
    "large": drawn(FEATURES, VALUES),
    "large_bias": drawn(FEATURES),
    "head": drawn(FEATURES, 5),
}


def car(*nodes: onnx.NodeProto, **weights: np.ndarray) -> onnx.ModelProto:
    return network(list(nodes), {**WEIGHTS, **weights})


def gate(model: onnx.ModelProto) -> Canonical:
    return check_onnx(model.SerializeToString(), META)


def fast(canonical: Canonical) -> bytes:
    """The network as the runtime gets it."""
    return write_model(dense_as_convolutions(CanonicalNetwork.read(canonical.onnx), dict(canonical.facts.shapes)))


def operations(network: bytes) -> list[str]:
    return [node.op_type for node in onnx.load_from_string(network).graph.node]


def answers(onnx_bytes: bytes) -> np.ndarray:
    """What a network says of a few frames."""
    runtime = onnxruntime.InferenceSession(onnx_bytes, providers=["CPUExecutionProvider"])
    frames = np.random.default_rng(3).integers(0, 256, (4, 1, 120, 160, 1)).astype(np.uint8)
    return np.concatenate([runtime.run(None, {CAMERA: frame})[0] for frame in frames])


REWRITTEN = {
    "over a flattened picture": lambda: car(*FLAT, dense(), *END),
    "over a picture that lies channels last": lambda: car(*LAST, dense(), *END),
    "over the frame itself": lambda: car(*RAW, dense(), *END, large=drawn(FEATURES, FRAME)),
    "with its weights the other way": lambda: car(*FLAT, dense(transB=0), *END, large=drawn(VALUES, FEATURES)),
    "without a bias": lambda: car(*FLAT, op("Gemm", ["flat", "large"], ["made"], transB=1), *END),
    "as a product and a sum": lambda: car(
        *FLAT,
        op("MatMul", ["flat", "large"], ["product"]),
        op("Add", ["product", "large_bias"], ["made"]),
        *END,
        large=drawn(VALUES, FEATURES),
    ),
    "over a row that others read": lambda: car(
        *FLAT,
        dense(made="this"),
        op("ReduceMean", ["flat"], ["that"], axes=[1]),
        op("Add", ["this", "that"], ["made"]),
        *END,
    ),
    "whose values two others read": lambda: car(
        *FLAT, dense(made="this"), op("Relu", ["this"], ["that"]), op("Add", ["this", "that"], ["made"]), *END
    ),
    "over a row of constants": lambda: car(
        dense(row="same"),
        *END[:1],
        op("Gemm", ["found", "head", "bias"], ["this"]),
        op("Add", ["this", "row"], ["scores"]),
        same=drawn(1, VALUES),
    ),
    "of which the scores are a part": lambda: car(
        *FLAT, dense(), op("Split", ["made", "parts"], ["scores", "rest"], axis=1), parts=np.array([5, FEATURES - 5])
    ),
    "after another": lambda: car(
        *FLAT,
        op("Gemm", ["flat", "first"], ["between"], transB=1),
        dense(row="between"),
        *END,
        first=drawn(256, VALUES),
        large=drawn(8192, 256),
        large_bias=drawn(8192),
        head=drawn(8192, 5),
    ),
}
LEFT = {
    "scaled": lambda: car(*FLAT, dense(alpha=0.5), *END),
    "with a scaled bias": lambda: car(*FLAT, dense(beta=2.0), *END),
    "with one bias for all": lambda: car(*FLAT, dense(), *END, large_bias=drawn(1)),
    "with a row of no whole blocks": lambda: car(
        *FLAT, op("Concat", ["flat", "three"], ["longer"], axis=1), dense(row="longer"), *END,
        three=drawn(1, 3), large=drawn(FEATURES, VALUES + 3),
    ),
    "with few outputs": lambda: car(
        *FLAT, op("Reshape", ["scaled", "as_frame"], ["dots"]), op("Concat", ["flat", "dots"], ["both"], axis=1),
        dense(row="both"), *END, as_frame=np.array([1, FRAME]), large=drawn(LEAST_OUTPUTS - 1, VALUES + FRAME),
        large_bias=drawn(LEAST_OUTPUTS - 1), head=drawn(LEAST_OUTPUTS - 1, 5),
    ),
    "whose weights two read": lambda: car(
        *FLAT, dense(), dense(made="again"), op("Add", ["made", "again"], ["found"]), HEAD
    ),
    "over several rows": lambda: car(
        *SEEN, op("Reshape", ["on", "as_rows"], ["flat"]), dense(), op("ReduceMean", ["made"], ["found"], axes=[0]),
        HEAD, as_rows=np.array([39, VALUES // 39]), large=drawn(8192, VALUES // 39), large_bias=drawn(8192),
        head=drawn(8192, 5),
    ),
    "that is small": lambda: car(
        *FLAT, dense(), *END, large=drawn(100, VALUES), large_bias=drawn(100), head=drawn(100, 5)
    ),
}  # fmt: skip
ALL = REWRITTEN | LEFT


@pytest.mark.parametrize("name", ALL)
def test_the_answers_do_not_change(name: str) -> None:
    model = ALL[name]()
    expected = answers(model.SerializeToString())
    canonical = gate(model)
    for form in (canonical.onnx, fast(canonical)):
        np.testing.assert_allclose(answers(form), expected, rtol=0, atol=1e-5 * np.abs(expected).max())
    found, _ = loaded_answers(canonical)
    np.testing.assert_allclose(found, answers(fast(canonical)), rtol=0, atol=1e-5 * np.abs(expected).max())


def loaded_answers(canonical: Canonical) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """What the loaded network says of a few frames, and the shapes of weights that are not the runtime's own copies."""
    loaded = load(canonical.onnx, canonical.facts)
    frames = np.random.default_rng(3).integers(0, 256, (4, 1, 120, 160, 1)).astype(np.uint8)
    found = np.concatenate([loaded.session.run(None, {CAMERA: frame})[0] for frame in frames])
    return found, [array.shape for array in loaded.arrays]


@pytest.mark.skipif(arranger() is None, reason="the runtime has no blocks on this processor")
@pytest.mark.parametrize("name", REWRITTEN)
def test_weights_come_to_the_runtime_in_its_own_order(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    canonical = gate(REWRITTEN[name]())
    found, shapes = loaded_answers(canonical)
    assert any(shape[1:3] == (CHANNELS, 1) for shape in shapes)
    monkeypatch.setattr(session, "in_blocks", lambda weights: None)  # another processor
    expected, shapes = loaded_answers(canonical)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_a_runtime_that_refuses_its_own_order_arranges_weights_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    canonical = gate(REWRITTEN["over a flattened picture"]())
    expected, _ = loaded_answers(canonical)
    monkeypatch.setattr(dense_module, "DOMAIN", "com.example")
    found, shapes = loaded_answers(canonical)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())
    assert shapes == [(FEATURES, 16, 29, 39)]


@pytest.mark.parametrize("name", ALL)
def test_the_form_is_a_fixed_point_and_valid(name: str) -> None:
    canonical = gate(ALL[name]())
    assert check_onnx(canonical.onnx, META) == canonical
    for form in (canonical.onnx, fast(canonical)):
        onnx.checker.check_model(onnx.load_from_string(form), full_check=True)


@pytest.mark.parametrize("name", ALL)
def test_the_identity_is_the_hash_of_the_form_before(name: str) -> None:
    canonical = gate(ALL[name]())
    assert canonical.sha256 == identity(canonical.onnx, META)
    assert operations(canonical.onnx).count("Conv") == ("over the frame itself" != name != "over a row of constants")


@pytest.mark.parametrize("name", REWRITTEN)
def test_no_large_matrix_product_is_left(name: str) -> None:
    canonical = gate(REWRITTEN[name]())
    assert set(readers_of_large(fast(canonical))) == {"Conv"}
    assert not set(readers_of_large(canonical.onnx)) & {"Conv"}


@pytest.mark.parametrize("name", LEFT)
def test_other_matrix_products_do_not_change(name: str) -> None:
    canonical = gate(LEFT[name]())
    assert set(readers_of_large(fast(canonical))) <= {"Gemm"}
    assert operations(fast(canonical)).count("Conv") == 1


def readers_of_large(network: bytes) -> list[str]:
    """The operations that read as many weights as a large dense layer has."""
    graph = onnx.load_from_string(network).graph
    large = {one.name for one in graph.initializer if np.prod(one.dims) >= LEAST_WEIGHTS}
    return [node.op_type for node in graph.node if large & set(node.input)]


@pytest.mark.parametrize("name", ["over a flattened picture", "over a picture that lies channels last"])
def test_a_picture_passes_between_convolutions_unflattened(name: str) -> None:
    found = operations(fast(gate(REWRITTEN[name]())))
    assert found[-6:] == ["Conv", "Relu", "Conv", "Relu", "Reshape", "Gemm"]
    assert "Flatten" not in found


def test_its_size_and_cost_are_those_of_its_layers() -> None:
    canonical = gate(REWRITTEN["over a flattened picture"]())
    assert canonical.parameters == 16 * 64 + FEATURES * (VALUES + 1) + 5 * (FEATURES + 1)
    assert canonical.macs == VALUES * 64 + FEATURES * VALUES + 5 * FEATURES


def test_overflowing_answers_are_still_detected() -> None:
    huge = car(*FLAT, dense(), *END, large=np.full((FEATURES, VALUES), 3e38, np.float32))
    with pytest.raises(UserFault) as caught:
        admit_network(ONNX, huge.SerializeToString(), META, DEFAULT_LIMITS)
    assert caught.value.code == "network_non_finite"


def test_every_session_gives_bit_identical_answers() -> None:
    canonical = gate(REWRITTEN["over a flattened picture"]())
    feed = {CAMERA: np.random.default_rng(3).integers(0, 256, (1, 120, 160, 1)).astype(np.uint8)}
    assert len({load(canonical.onnx, canonical.facts).session.run(None, feed)[0].tobytes() for _ in range(4)}) == 1
