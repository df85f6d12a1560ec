"""Graphs that TensorFlow itself wrote become ONNX that answers as TensorFlow does: every head, depth and sensor."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from paddock.packages.admission import admit_network
from paddock.packages.gate import check_onnx
from paddock.packages.kinds import TENSORFLOW
from paddock.packages.metadata import ModelMetadata, parse_metadata
from paddock.packages.tensorflow import convert

from . import tensorflow_graphs as made
from .coach import metadata_dict
from .test_conversion import WIDE, admit, ours
from .test_export import frozen_graph

CASES = {case.name: case for case in made.cases()}


@cache
def archive() -> dict[str, bytes]:
    with tarfile.open(made.ARCHIVE) as packed:
        return {member.name: packed.extractfile(member).read() for member in packed}  # type: ignore[union-attr]


def metadata_of(case: made.Case) -> ModelMetadata:
    head = "sac" if case.head.startswith("sac") else case.head
    return parse_metadata(json.dumps(metadata_dict(list(case.sensors), case.depth, head)).encode())


def expected_of(name: str) -> np.ndarray:
    answer = np.array(json.loads(archive()[f"{name}.json"]), np.float32)
    case = CASES[name]
    return np.tanh(answer) if case.head.startswith("sac") and case.head != "sac_tanh" else answer


def test_the_archive_holds_every_graph() -> None:
    assert set(archive()) == {f"{name}.{suffix}" for name in CASES for suffix in ("pb", "json")}


@pytest.mark.parametrize("name", CASES)
def test_a_graph_of_tensorflow_answers_as_tensorflow_does(name: str) -> None:
    case, expected = CASES[name], expected_of(name)
    metadata = metadata_of(case)
    answer = ours(admit(archive()[f"{name}.pb"], metadata), {sensor: made.frame(sensor) for sensor in case.sensors})
    assert answer.shape == (1, metadata.output_size)
    assert np.ptp(expected) > 1e-3, "a network that always answers the same proves nothing"
    np.testing.assert_allclose(answer, expected, atol=2e-5, rtol=2e-4)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("sac_slices-shallow-FRONT_FACING_CAMERA-first", "observation"),
        ("sac_slices-shallow-observation-first", "FRONT_FACING_CAMERA"),
    ],
)
def test_both_names_of_the_front_camera_are_the_same(name: str, said: str) -> None:
    """A car may have been exported with one and kept metadata with the other."""
    case = CASES[name]
    metadata = metadata_of(made.Case(case.head, case.depth, (said,)))
    (frame,) = (made.frame(sensor) for sensor in case.sensors)
    answer = ours(admit(archive()[f"{name}.pb"], metadata), {said: frame})
    np.testing.assert_allclose(answer, expected_of(name), atol=2e-5, rtol=2e-4)


@pytest.mark.parametrize(
    "name", ["sac_slices-shallow-FRONT_FACING_CAMERA-first", "sac_slices-deep-FRONT_FACING_CAMERA-SECTOR_LIDAR-second"]
)
def test_a_sliced_sac_head_is_admitted_and_exported(name: str) -> None:
    """The whole admission: the gate, float64 beside float32, and the canonical network in the formats of others."""
    metadata = metadata_of(CASES[name])
    canonical = admit_network(TENSORFLOW, archive()[f"{name}.pb"], metadata, WIDE)
    again = convert(frozen_graph(canonical.onnx, metadata), metadata.inputs, WIDE)
    assert check_onnx(again, metadata, WIDE).sha256 == canonical.sha256


@pytest.mark.soak
@pytest.mark.parametrize("version", ["first", "second"])
def test_the_archive_is_what_tensorflow_writes_today(version: str, tmp_path: Path) -> None:
    """Every graph anew, by the TensorFlow that can be installed here: 300 MB to fetch."""
    target = tmp_path / "tensorflow"
    packages = ["tensorflow-cpu", "tf_keras"]
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(target), *packages]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"TensorFlow cannot be installed here: {done.stderr.strip()[-300:]}")
    graphs = tmp_path / "graphs"
    graphs.mkdir()
    command = [sys.executable, str(Path(made.__file__)), version, str(graphs)]
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": str(target)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    for name, case in CASES.items():
        if case.version == version:
            assert json.loads((graphs / f"{name}.json").read_text()) == pytest.approx(
                json.loads(archive()[f"{name}.json"]), abs=1e-5
            )
            admit((graphs / f"{name}.pb").read_bytes(), metadata_of(case))
