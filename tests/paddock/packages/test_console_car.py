"""The car that the AWS console trained."""

from __future__ import annotations

import io
import json

import numpy as np
import onnxruntime
import pytest
from PIL import Image

from evaluation.garage.admission import AdmittedPackage, admit
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import RawPackage, UploadPart, read_upload
from paddock.packages.tensorflow import convert
from paddock.packages.tensorflow.graph import read_graph
from tests.shared import CONSOLE_CAR, SHARED, needs_shared

from .coach import coach_graph
from .test_conversion import openvinos

pytestmark = needs_shared
IDENTITY = "ed6f34d5ec54e8d05ea9a3d003ea709886fb39d91179771bdf4b50cbc499e771"


@pytest.fixture(scope="module")
def package() -> RawPackage:
    with CONSOLE_CAR.open("rb") as file:
        return read_upload([UploadPart(CONSOLE_CAR.name, file)])


@pytest.fixture(scope="module")
def admitted() -> AdmittedPackage:
    with CONSOLE_CAR.open("rb") as file:
        return admit([UploadPart(CONSOLE_CAR.name, file)])


def picture(name: str) -> np.ndarray:
    """A frame as the car sees it; how, golden.json says."""
    image = Image.open(SHARED / "models" / name).convert("RGB").resize((160, 120), Image.Resampling.BILINEAR)
    grey = np.floor(np.asarray(image, np.float64) @ [0.2989, 0.5870, 0.1140])
    return grey.astype(np.uint8)[np.newaxis, :, :, np.newaxis]


def test_it_is_admitted_with_the_right_facts(admitted: AdmittedPackage) -> None:
    assert admitted.source_kind == "tensorflow"
    assert admitted.parameters == 5_845_676
    assert admitted.metadata.sensors == ("FRONT_FACING_CAMERA",)
    assert admitted.metadata.output_size == 12
    assert len(admitted.onnx) < 24 * 1024 * 1024


def test_its_identity_is_the_same_everywhere(admitted: AdmittedPackage) -> None:
    assert admitted.sha256 == IDENTITY


def test_it_answers_the_golden_frames(admitted: AdmittedPackage) -> None:
    golden = json.loads((SHARED / "models" / "golden.json").read_text())
    session = onnxruntime.InferenceSession(admitted.onnx, providers=["CPUExecutionProvider"])
    for name, expected in golden["frames"].items():
        scores = session.run(None, {"FRONT_FACING_CAMERA": picture(name)})[0][0]
        assert int(scores.argmax()) == expected["action"]
        assert scores.max() == pytest.approx(expected["probability"], abs=golden["tolerance"])


def test_it_answers_as_openvino_does(package: RawPackage, tmp_path) -> None:
    metadata = parse_metadata(package.metadata_json)
    session = onnxruntime.InferenceSession(convert(package.model, metadata.inputs), providers=["CPUExecutionProvider"])
    for name in ("dr-demo-1.png", "dr-demo-2.png", "dr-demo-3.png"):
        feed = {"FRONT_FACING_CAMERA": picture(name)}
        np.testing.assert_allclose(
            session.run(None, feed)[0], openvinos(package.model, feed, tmp_path), atol=1e-5, rtol=1e-4
        )


def test_the_racing_form_answers_as_the_converted_one(package: RawPackage, admitted: AdmittedPackage) -> None:
    """The form that races differs in its large dense layer: only the order of additions may change."""
    metadata = parse_metadata(package.metadata_json)
    converted, raced = (
        onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
        for data in (convert(package.model, metadata.inputs), admitted.onnx)
    )
    noise = np.random.default_rng(1).integers(0, 256, (1, 120, 160, 1)).astype(np.uint8)
    for frame in (picture("dr-demo-1.png"), picture("dr-demo-2.png"), picture("dr-demo-3.png"), noise, noise * 0):
        before, after = (session.run(None, {"FRONT_FACING_CAMERA": frame})[0] for session in (converted, raced))
        np.testing.assert_allclose(after, before, atol=1e-5, rtol=0)
        assert after.argmax() == before.argmax()


def test_its_onnx_form_uploaded_again_is_the_same_model(admitted: AdmittedPackage) -> None:
    metadata = json.dumps(admitted.metadata.to_dict()).encode()
    again = admit([UploadPart("a", io.BytesIO(metadata)), UploadPart("b", io.BytesIO(admitted.onnx))])
    assert again.source_kind == "onnx"
    assert again.sha256 == admitted.sha256


def test_our_test_networks_are_built_like_the_consoles(package: RawPackage) -> None:
    """Every node of the real graph: same name, same operation, same inputs."""
    real, built = (
        {node.name: (node.op, node.inputs, node.controls) for node in read_graph(data, DEFAULT_LIMITS).nodes.values()}
        for data in (package.model, coach_graph(actions=12))
    )
    assert built == real
