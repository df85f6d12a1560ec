"""The console's five-layer network, of 28.7 million weights, and of 57.3 million with stereo cameras: admitted whole,
within the memory that each process may use, and driven. The archives are made here: none of 100 MB is kept."""

from __future__ import annotations

import io
import json
import tarfile
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.sandbox.policy import PolicyProcess
from paddock.errors import UserFault
from paddock.network.policy_wire import EXACT, FAST
from paddock.packages.limits import DEFAULT_LIMITS, MEGABYTE
from paddock.packages.read import UploadPart
from tests.hostile.parts import regular
from tests.paddock.packages.coach import MEDIUM, coach_graph, metadata_dict

pytestmark = [pytest.mark.xdist_group("large networks"), pytest.mark.slow]  # one after the other: they are large
ACTIONS = 5


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(("FRONT_FACING_CAMERA", 28_744_741, 114_999_851), id="front camera"),
        pytest.param(("STEREO_CAMERAS", 57_624_549, 230_512_973), id="stereo cameras", marks=pytest.mark.soak),
    ],
)
def network(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """Sensor, the admitted car, the size of its graph, and the most that this process held meanwhile."""
    sensor, weights, size = request.param
    graph = coach_graph([sensor], MEDIUM, "discrete", ACTIONS, activation="Tanh")
    assert len(graph) == size, "the size of the field's own files"
    archive = tmp_path_factory.mktemp("large") / "model.tar.gz"
    said = json.dumps(metadata_dict([sensor], MEDIUM, "discrete", ACTIONS)).encode()
    with tarfile.open(archive, "w:gz", compresslevel=0) as tar:
        for name, content in (("agent/model.pb", graph), ("model_metadata.json", said)):
            info, _ = regular(name, content)
            tar.addfile(info, io.BytesIO(content))
    del graph
    assert archive.stat().st_size > 100 * MEGABYTE
    tracemalloc.start()
    try:
        with archive.open("rb") as stream:
            car = admit([UploadPart(archive.name, stream)])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        archive.unlink()
    return sensor, weights, size, car, peak


def test_it_is_admitted_with_all_of_its_weights(network: tuple[str, int, int, AdmittedPackage, int]) -> None:
    _sensor, weights, size, car, _peak = network
    assert car.parameters == weights
    assert abs(len(car.onnx) - size) < MEGABYTE
    assert car.macs < DEFAULT_LIMITS.macs


def test_the_site_holds_it_in_memory_about_once(network: tuple[str, int, int, AdmittedPackage, int]) -> None:
    _sensor, _weights, size, _car, peak = network
    assert peak < 1.5 * size


@pytest.mark.parametrize("bound", ["its own", None])
def test_it_drives_within_a_policys_memory_limit(
    network: tuple[str, int, int, AdmittedPackage, int], bound: str | None
) -> None:
    """Also where each answer is computed in float64."""
    sensor, _weights, _size, car, _peak = network
    shape = list(car.metadata.inputs[0].shape)
    header = {"inputs": [{"name": sensor, "dtype": "uint8", "shape": shape}], "outputs": ACTIONS, "ranges": None}
    facts = car.facts if bound else replace(car.facts, bound=None)
    with PolicyProcess() as policy:
        policy.load(car.onnx, header, facts.to_dict())
        client = policy.client(header)
        for brightness in (0, 255):
            scores = client({sensor: np.full(shape, brightness, np.uint8)})
            assert scores.sum() == pytest.approx(1, abs=1e-5)
        assert client.counts[FAST if bound else EXACT] == 2


def test_a_smaller_limit_refuses_it_and_is_named(network: tuple[str, int, int, AdmittedPackage, int]) -> None:
    *_, car, _peak = network
    limits = replace(DEFAULT_LIMITS, model_bytes=100 * MEGABYTE)
    files = [UploadPart("car.onnx", io.BytesIO(car.onnx)), UploadPart("m.json", io.BytesIO(b"{}"))]
    with pytest.raises(UserFault) as fault:
        admit(files, limits)
    assert (fault.value.code, fault.value.params) == ("model_too_large", {"limit_mb": 100})
